#ifndef FORGE_CDR__ERROR_HPP_
#define FORGE_CDR__ERROR_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <stdexcept>

namespace forge_cdr
{

/// Invalid data, or a buffer that is too small; what() contains the reason and the offset.
class Error : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

}  // namespace forge_cdr

#endif  // FORGE_CDR__ERROR_HPP_
