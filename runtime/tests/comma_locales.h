// Locales whose decimal point is something else.
#pragma once

#include <gtest/gtest.h>
#include <locale.h>

// Calls `check` within each that is installed; skips the test where none is.
template <class Check>
void in_comma_locales(Check check) {
  int tried = 0;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "fa_IR.UTF-8", "ps_AF.UTF-8"}) {
    if (const locale_t locale = newlocale(LC_ALL_MASK, name, nullptr)) {
      SCOPED_TRACE(name);
      const locale_t before = uselocale(locale);
      check();
      uselocale(before);
      freelocale(locale);
      ++tried;
    }
  }
  if (!tried) {
    GTEST_SKIP() << "no locale with a decimal comma is installed";
  }
}
