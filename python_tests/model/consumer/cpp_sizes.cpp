// The C++ interface: no library of its own.
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <tendonfmu.hpp>

int main(int, char** arguments) {
  std::ifstream file(arguments[1]);
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  const tendonfmu::finger finger = tendonfmu::finger::from_json(json).value();
  std::cout << finger.joint_count() << ' ' << finger.tendon_count() << '\n';
}
