// tendonfmu.hpp in a program without exceptions and without run-time types, as on a microcontroller: compiled with
// -fno-exceptions -fno-rtti. The exit status is the number of the check that failed.
#include <vector>

#include "tendonfmu.hpp"
#include "test_finger.h"

#if defined(TENDONFMU_HAS_EXCEPTIONS)
#error "expected to be compiled without exceptions"
#endif

using tendonfmu::status;

int main() {
  if (tendonfmu::finger::from_json("{}").code() != status::bad_image) {
    return 1;
  }
  const std::vector<unsigned char> image = test_finger::image();
  std::vector<unsigned char> memory(tendonfmu::finger::memory_size(image));
  auto placed = tendonfmu::finger::place(memory, image);
  if (!placed) {
    return 2;
  }
  tendonfmu::finger finger = *std::move(placed);

  const test_finger::Motion motion(2000);
  unsigned char contact = 0;
  int touched = 0;
  tendonfmu::outputs wanted;
  wanted.contact = tendonfmu::one(contact);
  for (std::size_t k = 0; k < motion.time.size(); ++k) {
    const tendonfmu_inputs row = motion.row(k);
    const tendonfmu::inputs sample = {{row.tendon_force, test_finger::tendons},
                                      {row.tendon_position, test_finger::tendons}};
    const status taken = k == 0 ? finger.initialise(motion.time[k], sample) : finger.step(motion.time[k], sample);
    if (taken != status::ok || finger.get_outputs(wanted) != status::ok) {
      return 3;
    }
    touched += contact;
  }
  return touched > 0 && touched < 2000 ? 0 : 4; /* pushed for a part of the time */
}
