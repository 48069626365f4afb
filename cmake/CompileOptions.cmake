# Compiler settings of every target. No flag is tied to the machine that compiles: faster kernels are picked at run time.

set(CMAKE_C_STANDARD 11)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

if(MSVC)
  add_compile_options(/W4 /fp:precise /utf-8 $<$<BOOL:${TENDONFMU_WERROR}>:/WX>)
else()
  # A fused multiply-add rounds once where the formulas round twice: results would depend on the machine.
  add_compile_options(-ffp-contract=off -Wall -Wextra $<$<BOOL:${TENDONFMU_WERROR}>:-Werror>)
endif()

if(TENDONFMU_SANITIZE)
  add_compile_options(-fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=address,undefined)
endif()

if(TENDONFMU_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "TENDONFMU_BUILD_FUZZERS needs clang (libFuzzer): configure with CC=clang CXX=clang++")
  endif()
  # Coverage counters for everything the fuzzers call; the fuzzers themselves link with -fsanitize=fuzzer.
  add_compile_options(-fsanitize=fuzzer-no-link)
  add_link_options(-fsanitize=fuzzer-no-link)
endif()
