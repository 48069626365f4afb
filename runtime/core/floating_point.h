/* Included first by every source that computes: no contraction of a*b + c into one rounding, whatever flags an importer
 * compiles with, so that all machines give the same bits. */
#pragma once

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
