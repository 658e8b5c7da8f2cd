// Write random messages of every type with forge_cdr and with Fast-CDR; print the types on which they differ.

#include <cstdlib>
#include <iostream>
#include <random>

#include "cdr_checks.hpp"
#include "peer_types.hpp"

namespace
{

template<typename Message>
bool agree(std::mt19937 & chance)
{
  for (int turn = 0; turn < 20; ++turn) {
    Message message;
    Filler(chance).message(message);
    const Bytes ours = forge_cdr::serialize(message);
    Bytes theirs(peer_size(message));  // zero, as Fast-CDR leaves padding as it is
    peer_serialize(message, reinterpret_cast<char *>(theirs.data()), theirs.size());
    Message same;
    peer_deserialize(reinterpret_cast<const char *>(ours.data()), ours.size(), same);
    if (ours != theirs || forge_cdr::serialize(same) != ours) {
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int, char ** argv)
{
  std::mt19937 chance(static_cast<unsigned>(std::atoi(argv[1])));
#define COMPARE(Message) if (!agree<Message>(chance)) {std::cout << #Message << "\n";}
  EACH(COMPARE)
  return 0;
}
