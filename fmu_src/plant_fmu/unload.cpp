/* libstdc++ keeps 72,704 bytes back for exceptions when memory is out. Linked into this library, they are its own:
 * nobody else gives them back when an importer unloads it. */
#include <exception>

#ifdef __GLIBCXX__
namespace __gnu_cxx {
// NOLINTNEXTLINE(readability-identifier-naming): libstdc++'s name
void __freeres();
}  // namespace __gnu_cxx

__attribute__((destructor)) static void free_reserve() {
  __gnu_cxx::__freeres();
}
#endif
