#include <stdio.h>
#include <tendonfmu.h>

int main(void) {
  return puts(tendonfmu_version()) < 0;
}
