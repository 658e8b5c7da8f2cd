#include "part_loader/part_loader.hpp"

#include <dlfcn.h>

namespace part_loader
{
int call(const std::string & library, const std::string & function)
{
  void * handle = dlopen(library.c_str(), RTLD_NOW);
  if (handle == nullptr) {
    return -1;
  }
  auto * address = reinterpret_cast<int (*)()>(dlsym(handle, function.c_str()));
  return address == nullptr ? -2 : address();
}
}  // namespace part_loader
