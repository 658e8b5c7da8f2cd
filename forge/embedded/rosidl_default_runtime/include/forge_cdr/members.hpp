// The description of messages in generated headers, for forge_cdr/forge_cdr.hpp.

#ifndef FORGE_CDR__MEMBERS_HPP_
#define FORGE_CDR__MEMBERS_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <cstddef>

namespace forge_cdr
{

/// The serialized layout of a message; generated headers specialize it for each message.
/**
 * least      the minimum serialized size in bytes
 * packed     the serialized size if it is fixed and without padding, else 0
 * alignment  if packed, the alignment of the first byte
 * visit      passes all members to a sizer, a writer or a reader, in serialization order; bounded strings, alone
 *            and in an array or a sequence, with their upper bound
 */
template<typename Message>
struct Members;

}  // namespace forge_cdr

#endif  // FORGE_CDR__MEMBERS_HPP_
