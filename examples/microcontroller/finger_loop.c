/* A finger on a microcontroller: no heap, no file, no text. The finger is a C array, made by
 *   tendonfmu build FINGER.json -o finger.h --c-array
 * and FINGER its name. */
#include <tendonfmu.h>

#include "board.h"
#include "finger.h"

#define JOIN(name, what)      name##what
#define OF_FINGER(name, what) JOIN(name, what)

enum { JOINTS = 16, TENDONS = 64 }; /* the most there can be */

static unsigned char memory[OF_FINGER(FINGER, _memory_size)];

/* what the controller gets of a sample */
static struct {
  double compensated_torque[JOINTS], friction_torque[JOINTS], bias_torque[JOINTS], deviation[JOINTS];
  unsigned char joint_contact[JOINTS], contact;
} given;

static const tendonfmu_outputs wanted = {.compensated_torque = given.compensated_torque,
                                         .friction_torque = given.friction_torque,
                                         .bias_torque = given.bias_torque,
                                         .compensated_torque_std = given.deviation,
                                         .joint_contact = given.joint_contact,
                                         .contact = &given.contact};

static tendonfmu_status take_sample(tendonfmu_finger* finger, const double* row, size_t tendons) {
  const tendonfmu_inputs inputs = {.tendon_force = row + 1, .tendon_position = row + 1 + tendons};
  const tendonfmu_status status = tendonfmu_is_initialised(finger) ? tendonfmu_step(finger, row[0], &inputs)
                                                                   : tendonfmu_initialise(finger, row[0], &inputs);
  return status == TENDONFMU_OK ? tendonfmu_get_outputs(finger, &wanted) : status;
}

static void write_outputs(size_t joints) {
  board_write(given.compensated_torque, joints * sizeof(double));
  board_write(given.friction_torque, joints * sizeof(double));
  board_write(given.bias_torque, joints * sizeof(double));
  board_write(given.deviation, joints * sizeof(double));
  board_write(given.joint_contact, joints);
  board_write(&given.contact, 1);
}

int main(void) {
  static double row[1 + 2 * TENDONS]; /* s, N, m */
  static char message[160];
  measured result = {.memory =
                         (uint32_t)tendonfmu_memory_size(OF_FINGER(FINGER, _image), sizeof OF_FINGER(FINGER, _image))};
  board_mark_stack();
  tendonfmu_finger* finger = tendonfmu_place(memory, sizeof memory, OF_FINGER(FINGER, _image),
                                             sizeof OF_FINGER(FINGER, _image), message, sizeof message);
  if (!finger) {
    board_say(message);
    return 1;
  }
  const size_t joints = tendonfmu_joint_count(finger), tendons = tendonfmu_tendon_count(finger);
  result.stack_to_place = board_stack_used();
  board_mark_stack();
  while (board_read(row, 1 + 2 * tendons)) {
    const uint32_t then = board_now();
    const tendonfmu_status status = take_sample(finger, row, tendons);
    const uint32_t taken = board_instructions_since(then);
    if (status != TENDONFMU_OK) {
      board_say(tendonfmu_last_error(finger)); /* the finger is as it was */
      return 1;
    }
    result.samples += 1;
    result.instructions += taken;
    result.most_instructions = taken > result.most_instructions ? taken : result.most_instructions;
    write_outputs(joints);
  }
  result.stack_of_step = board_stack_used();
  board_report(&result);
  return 0;
}
