#include "message.h"

#include <stdint.h>
#include <string.h>

static void add_text(message_line line, const char* text) {
  if (!line.size) {
    return;
  }
  const size_t used = strlen(line.text), room = line.size - 1 - used;
  const size_t wanted = strlen(text), taken = wanted < room ? wanted : room;
  for (size_t i = 0; i < taken; ++i) {
    /* texts of the caller may hold anything; a line stays a line */
    line.text[used + i] = (unsigned char)text[i] < 0x20 || text[i] == 0x7f ? '?' : text[i];
  }
  line.text[used + taken] = 0;
}

/* Integers below 2^1280, little end first: room for any double times the power of ten that makes its first digit one.
 */
enum { WORDS = 40 };
typedef struct whole {
  uint32_t word[WORDS];
} whole;

static void multiply(whole* x, uint32_t factor) {
  uint64_t carry = 0;
  for (int k = 0; k < WORDS; ++k, carry >>= 32) {
    carry += (uint64_t)x->word[k] * factor;
    x->word[k] = (uint32_t)carry;
  }
}

/* x·2^twos·10^tens; powers below 0 count as 0 */
static void scale(whole* x, int twos, int tens) {
  for (; twos > 0; --twos) {
    multiply(x, 2);
  }
  for (; tens > 0; --tens) {
    multiply(x, 10);
  }
}

static int compare(const whole* x, const whole* y) {
  int k = WORDS - 1;
  while (k > 0 && x->word[k] == y->word[k]) {
    --k;
  }
  return (x->word[k] > y->word[k]) - (x->word[k] < y->word[k]);
}

static void subtract(whole* x, const whole* y) {
  uint64_t borrow = 0;
  for (int k = 0; k < WORDS; ++k) {
    const uint64_t left = (uint64_t)x->word[k] - y->word[k] - borrow;
    x->word[k] = (uint32_t)left;
    borrow = left >> 63;
  }
}

/* The first `precision` digits of mantissa·2^twos, rounded, and the power of ten of the first; returns whether they
 * read back as the same number. */
static int find_digits(uint64_t mantissa, int twos, int precision, char* digits, int* power) {
  whole rest, unit, spacing; /* what is left, a digit's unit, the distance of neighbouring numbers: of one scale */
  *power = twos > -1074 ? (int)((twos + 52) * 0.30103 + 400.0) - 401 : -325;
  do {
    ++*power;
    rest = (whole){{(uint32_t)mantissa, (uint32_t)(mantissa >> 32)}};
    spacing = unit = (whole){{1}};
    scale(&rest, twos, -*power - 1);
    scale(&spacing, twos, -*power - 1);
    scale(&unit, -twos, *power + 1);
  } while (compare(&rest, &unit) >= 0);
  for (int i = 0; i < precision; ++i) {
    multiply(&rest, 10);
    multiply(&spacing, 10);
    for (digits[i] = '0'; compare(&rest, &unit) >= 0; ++digits[i]) {
      subtract(&rest, &unit);
    }
  }
  whole twice = rest;
  multiply(&twice, 2);
  const int half = compare(&twice, &unit), up = half > 0 || (half == 0 && digits[precision - 1] % 2 == 1);
  if (up) {
    subtract(&unit, &rest);
    twice = unit;
    multiply(&twice, 2);
    int i = precision - 1;
    while (i >= 0 && digits[i] == '9') {
      digits[i--] = '0';
    }
    digits[i < 0 ? 0 : i] = i < 0 ? '1' : (char)(digits[i] + 1);
    *power += i < 0;
  } else if (mantissa == (uint64_t)1 << 52) {
    multiply(&twice, 2); /* the neighbour below a power of two is nearer */
  }
  const int off = compare(&twice, &spacing);
  return off < 0 || (off == 0 && mantissa % 2 == 0);
}

/* Digits as printf writes them with %g: without zeros at the end, with an exponent where the number is long. */
static void write_digits(const char* digits, int precision, int power, char* text) {
  const int scientific = power < -4 || power >= precision, point = scientific ? 0 : power;
  int count = precision;
  while (count > 1 && digits[count - 1] == '0') {
    --count;
  }
  for (int i = point < 0 ? point : 0; i < count || i <= point; ++i) {
    *text++ = i >= 0 && i < count ? digits[i] : '0';
    if (i == point && i + 1 < count) {
      *text++ = '.';
    }
  }
  if (scientific) {
    const int size = power < 0 ? -power : power;
    *text++ = 'e';
    *text++ = power < 0 ? '-' : '+';
    if (size >= 100) {
      *text++ = (char)('0' + size / 100);
    }
    *text++ = (char)('0' + size / 10 % 10);
    *text++ = (char)('0' + size % 10);
  }
  *text = 0;
}

static void add_number(message_line line, double value) {
  char digits[17], text[40];
  uint64_t bits;
  int power = 0, precision = 6;
  memcpy(&bits, &value, sizeof bits);
  const int exponent = (int)(bits >> 52 & 2047), twos = exponent ? exponent - 1075 : -1074;
  const uint64_t fraction = bits & (((uint64_t)1 << 52) - 1), mantissa = fraction | (uint64_t)(exponent > 0) << 52;
  add_text(line, bits >> 63 ? "-" : "");
  if (exponent == 2047 || mantissa == 0) {
    add_text(line, mantissa == 0 ? "0" : fraction ? "nan" : "inf");
    return;
  }
  /* the shortest of the usual precisions that reads back as the same number */
  while (!find_digits(mantissa, twos, precision, digits, &power) && precision < 17) {
    precision += precision == 6 ? 9 : 2;
  }
  write_digits(digits, precision, power, text);
  add_text(line, text);
}

static void add_count(message_line line, size_t value) {
  char digits[24], *first = digits + sizeof digits - 1;
  *first = 0;
  do {
    *--first = (char)('0' + value % 10);
    value /= 10;
  } while (value);
  add_text(line, first);
}

void message_add_list(message_line line, const char* format, va_list arguments) {
  for (; *format; ++format) {
    const char plain[2] = {*format, '\0'};
    if (*format != '%') {
      add_text(line, plain);
      continue;
    }
    switch (*++format) {
      case 's': add_text(line, va_arg(arguments, const char*)); break;
      case 'g': add_number(line, va_arg(arguments, double)); break;
      default: add_count(line, va_arg(arguments, size_t)), ++format; break; /* %zu */
    }
  }
}

int message_add(message_line line, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  message_add_list(line, format, arguments);
  va_end(arguments);
  return -1;
}

int message_write(message_line line, const char* format, ...) {
  va_list arguments;
  if (line.size) {
    line.text[0] = 0;
  }
  va_start(arguments, format);
  message_add_list(line, format, arguments);
  va_end(arguments);
  return -1;
}
