#include <tendonfmu_description.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

int main(int, char** arguments) {
  std::ifstream file(arguments[1]);
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  char message[512] = "";
  void* image = nullptr;
  size_t size = 0;
  if (tendonfmu_image_from_json(json.data(), json.size(), &image, &size, message, sizeof message) != TENDONFMU_OK) {
    std::cerr << message << '\n';
    return 1;
  }
  tendonfmu_finger* finger = tendonfmu_create(image, size, message, sizeof message);
  tendonfmu_free_image(image);
  if (!finger)
    return 1;
  std::cout << tendonfmu_joint_count(finger) << ' ' << tendonfmu_tendon_count(finger) << '\n';
  tendonfmu_destroy(finger);
}
