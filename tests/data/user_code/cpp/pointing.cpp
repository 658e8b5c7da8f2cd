// Every alias for a pointer to a message.

#include <cassert>
#include <memory>
#include <type_traits>
#include <utility>

#include "geometry_msgs/msg/transform_stamped.hpp"

namespace pointing
{

using geometry_msgs::msg::TransformStamped;

static_assert(std::is_same_v<TransformStamped::SharedPtr, std::shared_ptr<TransformStamped>>);
static_assert(std::is_same_v<TransformStamped::ConstSharedPtr, std::shared_ptr<const TransformStamped>>);
static_assert(std::is_same_v<TransformStamped::UniquePtr, std::unique_ptr<TransformStamped>>);
static_assert(std::is_same_v<TransformStamped::ConstUniquePtr::element_type, const TransformStamped>);
static_assert(std::is_same_v<TransformStamped::WeakPtr, std::weak_ptr<TransformStamped>>);
static_assert(std::is_same_v<TransformStamped::ConstWeakPtr, std::weak_ptr<const TransformStamped>>);
static_assert(std::is_same_v<TransformStamped::RawPtr, TransformStamped *>);
static_assert(std::is_same_v<TransformStamped::ConstRawPtr, const TransformStamped *>);

double height(const TransformStamped::ConstSharedPtr & message)
{
  return message->transform.translation.z;
}

class Latest
{
public:
  void on_transform(TransformStamped::SharedPtr message)
  {
    seen_ = message;
    kept_ = std::move(message);
  }

  void forget()
  {
    kept_.reset();
  }

  bool alive() const
  {
    return !seen_.expired();
  }

private:
  TransformStamped::SharedPtr kept_;
  TransformStamped::ConstWeakPtr seen_;
};

void run()
{
  auto message = std::make_unique<TransformStamped>();
  message->transform.translation.z = 0.3;
  TransformStamped::UniquePtr owner = std::move(message);
  TransformStamped::SharedPtr shared = std::move(owner);
  assert(height(shared) == 0.3);
  Latest latest;
  latest.on_transform(shared);
  TransformStamped::ConstRawPtr raw = shared.get();
  assert(raw->transform.rotation.w == 1.0);
  shared.reset();
  assert(latest.alive());
  latest.forget();
  assert(!latest.alive());
}

}  // namespace pointing
