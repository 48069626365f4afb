/* Included first by every source that computes: no contraction of a*b + c into one rounding, and no sum or quotient in
 * another order, whatever flags an importer compiles with, so that all machines give the same bits. */
#pragma once

/* clang names no macro for the other flags of -ffast-math; the pragma below takes them back */
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(_M_FP_FAST)
#error "TendonFMU cannot be compiled with -ffast-math or a part of it: exponentials would be wrong"
#endif

#if defined(__clang__)
#pragma float_control(precise, on)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off", "no-associative-math")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
