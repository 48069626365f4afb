/* What finger_loop.c needs of a board. mps2_an500.c is QEMU's; yours reads sensors and writes to a controller. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* The next `count` doubles that the sensors give; 0 at the end. */
int board_read(double* numbers, size_t count);

/* What a sample gives, to the controller. */
void board_write(const void* bytes, size_t size);

/* One line for a person. */
void board_say(const char* line);

/* What was measured: bytes of memory and of stack, samples, instructions. */
typedef struct measured {
  uint32_t memory, stack_to_place, stack_of_step, samples;
  uint64_t instructions;
  uint32_t most_instructions;
} measured;
void board_report(const measured* result);

/* Instructions so far, modulo what board_instructions_since() takes back; fewer than 10 million between two calls. */
uint32_t board_now(void);
uint32_t board_instructions_since(uint32_t then);

/* Marks the unused stack, and says how much of it was used since. */
void board_mark_stack(void);
uint32_t board_stack_used(void);
