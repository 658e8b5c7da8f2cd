#include <iostream>

int main()
{
  std::cout << "hello world walker package\n";
  return 0;
}
