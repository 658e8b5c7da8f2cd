// Messages with fields of every kind are read as written, by code that the compiler has to inline.

#include "forge_cdr/forge_cdr.hpp"
#include "wire/msg/collections.hpp"
#include "wire/msg/letters.hpp"
#include "wire/msg/strs.hpp"
#include "wire/msg/w.hpp"

namespace
{

template<typename Message>
bool is_read_as_written()
{
  const Message message;
  const auto bytes = forge_cdr::serialize(message);
  return forge_cdr::deserialize<Message>(bytes.data(), bytes.size()) == message;
}

}  // namespace

int main()
{
  const bool all = is_read_as_written<wire::msg::Collections>() && is_read_as_written<wire::msg::Letters>() &&
    is_read_as_written<wire::msg::Strs>() && is_read_as_written<wire::msg::W>();
  return all ? 0 : 1;
}
