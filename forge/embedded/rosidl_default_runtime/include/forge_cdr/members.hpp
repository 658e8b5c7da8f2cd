// What generated headers say about messages, so that forge_cdr/forge_cdr.hpp can write and read them.

#ifndef FORGE_CDR__MEMBERS_HPP_
#define FORGE_CDR__MEMBERS_HPP_

#include <cstddef>

namespace forge_cdr
{

/// How a message lies on the wire; specialised beside every message.
/**
 * least      the fewest bytes that such a message takes
 * packed     how many bytes every such message takes if it never has padding inside, else 0
 * alignment  with that, what the offset of its first byte is a multiple of
 * visit      hands all members to a sizer, a writer or a reader, in the order of the bytes
 */
template<typename Message>
struct Members;

}  // namespace forge_cdr

#endif  // FORGE_CDR__MEMBERS_HPP_
