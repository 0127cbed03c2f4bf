#pragma once

#include <cfloat>

// The build includes this file before the first line of every source file of the engine.
//
// Contacts have the same bits on every machine only if the compiler does not rearrange arithmetic. An embedder may
// compile its own files, with the public headers that they include, with -ffast-math; Ringfence's own files refuse it.

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0) || \
    defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "Ringfence's own files must not be compiled with -ffast-math, -Ofast or a part of them: remove the option"
#endif

#if FLT_EVAL_METHOD != 0
#error "Ringfence needs arithmetic in the precision of its types: on 32-bit x86, compile with -mfpmath=sse -msse2"
#endif
