/* The board mps2-an500 (Cortex-M7) of QEMU: start-up, semihosting in place of sensors and controller, and SysTick as
 * the counter of instructions. With `-icount shift=6` an instruction takes 64 ns; SysTick counts at 25 MHz, 40 ns a
 * tick. */
#include <string.h>

#include "board.h"

int main(void);

/* of mps2_an500.ld */
extern unsigned char stack_begin[], stack_end[], data_begin[], data_end[], data_stored[], bss_begin[], bss_end[];

#define REGISTER(address)   (*(volatile uint32_t*)(address))
#define SYSTICK_CONTROL     REGISTER(0xe000e010u)
#define SYSTICK_RELOAD      REGISTER(0xe000e014u)
#define SYSTICK_NOW         REGISTER(0xe000e018u)
#define COPROCESSOR_ACCESS  REGISTER(0xe000ed88u)
#define FPU_FULL_ACCESS     (0xfu << 20)
#define TICKS               0x1000000u
#define INSTRUCTIONS(ticks) ((ticks)*5u / 8u)

/* --- semihosting: the debugger, here QEMU, reads and writes files ------------------------------------------------- */

enum { OPEN = 1, WRITE_TEXT = 4, WRITE = 5, READ = 6, EXIT = 0x20 };
enum { READ_BINARY = 1, WRITE_BINARY = 5 };

static int32_t host(uint32_t operation, const void* arguments) {
  register uint32_t r0 __asm__("r0") = operation;
  register const void* r1 __asm__("r1") = arguments;
  __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return (int32_t)r0;
}

static uint32_t open_file(const char* name, uint32_t mode) {
  const uint32_t arguments[] = {(uint32_t)name, mode, strlen(name)};
  return (uint32_t)host(OPEN, arguments);
}

static uint32_t samples, outputs;

int board_read(double* numbers, size_t count) {
  const uint32_t arguments[] = {samples, (uint32_t)numbers, count * sizeof(double)};
  return host(READ, arguments) == 0;
}

void board_write(const void* bytes, size_t size) {
  const uint32_t arguments[] = {outputs, (uint32_t)bytes, size};
  host(WRITE, arguments);
}

void board_report(const measured* result) {
  const uint32_t arguments[] = {open_file("measured.bin", WRITE_BINARY), (uint32_t)result, sizeof *result};
  host(WRITE, arguments);
}

void board_say(const char* line) {
  host(WRITE_TEXT, line);
}

/* --- what is measured --------------------------------------------------------------------------------------------- */

uint32_t board_now(void) {
  return SYSTICK_NOW;
}

uint32_t board_instructions_since(uint32_t then) {
  return INSTRUCTIONS((then - SYSTICK_NOW) % TICKS); /* it counts down */
}

enum { MARK = 0xa5 };

void board_mark_stack(void) {
  uint32_t here;
  __asm__ volatile("mov %0, sp" : "=r"(here));
  for (volatile unsigned char* from = stack_begin; (uint32_t)from < here; ++from) {
    *from = MARK;
  }
}

uint32_t board_stack_used(void) {
  const volatile unsigned char* from = stack_begin;
  while (*from == MARK) {
    ++from;
  }
  return (uint32_t)(stack_end - (const unsigned char*)from);
}

/* --- start-up ----------------------------------------------------------------------------------------------------- */

static void leave(uint32_t status) {
  const uint32_t arguments[] = {0x20026, status}; /* ADP_Stopped_ApplicationExit */
  host(EXIT, arguments);
}

static void fail(void) {
  board_say("fault\n");
  leave(2);
}

__attribute__((noreturn)) void board_reset(void);
void board_reset(void) {
  COPROCESSOR_ACCESS |= FPU_FULL_ACCESS;
  __asm__ volatile("dsb\n isb");
  memcpy(data_begin, data_stored, (size_t)(data_end - data_begin));
  memset(bss_begin, 0, (size_t)(bss_end - bss_begin));
  SYSTICK_RELOAD = TICKS - 1;
  SYSTICK_NOW = 0;
  SYSTICK_CONTROL = 5; /* of the processor's clock, without interrupt */
  samples = open_file("samples.bin", READ_BINARY);
  outputs = open_file("outputs.bin", WRITE_BINARY);
  leave((uint32_t)main());
  for (;;) {
  }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))(uintptr_t)stack_end, board_reset, fail, fail, fail, fail, fail};
