#include "part_loader/part_loader.hpp"

extern "C" int part_number() {return 4;}
