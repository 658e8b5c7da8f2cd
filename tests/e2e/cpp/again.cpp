// Read messages of any type from standard input, write them again; or read many spoilt ones.
//
// again                 records of three: the number of a type in types.hpp, a size, so many bytes; answers
//                       with size and bytes for each, then with size and text of the message as YAML
// again TIMES SEED      reads so many spoilt buffers of each type; prints the types that did not survive it

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>

#include "cdr_checks.hpp"
#include "types.hpp"

namespace
{

using Answer = void (*)(const Bytes &);
using Survives = bool (*)(std::size_t, std::mt19937 &);

template<typename Text>
void put(const Text & text)
{
  const auto size = static_cast<std::uint32_t>(text.size());
  std::cout.write(reinterpret_cast<const char *>(&size), sizeof(size));
  std::cout.write(reinterpret_cast<const char *>(text.data()), static_cast<std::streamsize>(text.size()));
}

template<typename Message>
void answer(const Bytes & bytes)
{
  Message message;
  forge_cdr::deserialize(bytes, message);
  put(forge_cdr::serialize(message));
  put(to_yaml(message));
}

struct Type
{
  const char * name;
  Answer answer;
  Survives survives;
};

#define TYPE(Message) Type{#Message, answer<Message>, survives<Message>},
const Type types[] = {EACH(TYPE)};

bool get(std::uint32_t & number)
{
  return static_cast<bool>(std::cin.read(reinterpret_cast<char *>(&number), sizeof(number)));
}

}  // namespace

int main(int argc, char ** argv)
{
  if (argc > 2) {
    std::mt19937 chance(static_cast<unsigned>(std::atoi(argv[2])));
    for (const Type & type : types) {
      if (!type.survives(static_cast<std::size_t>(std::atol(argv[1])), chance)) {
        std::cout << type.name << "\n";
      }
    }
    return 0;
  }
  std::uint32_t type;
  std::uint32_t size;
  while (get(type) && get(size)) {
    Bytes bytes(size);
    std::cin.read(reinterpret_cast<char *>(bytes.data()), size);
    types[type].answer(bytes);
  }
  return 0;
}
