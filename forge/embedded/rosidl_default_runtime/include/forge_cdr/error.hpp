#ifndef FORGE_CDR__ERROR_HPP_
#define FORGE_CDR__ERROR_HPP_

#include <stdexcept>

namespace forge_cdr
{

/// Bytes that hold no such message, or a place too small for one; what() says what and where.
class Error : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

}  // namespace forge_cdr

#endif  // FORGE_CDR__ERROR_HPP_
