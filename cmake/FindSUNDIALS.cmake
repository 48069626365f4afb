# Finds the headers and static libraries of SUNDIALS' CVODE: SUNDIALS_INCLUDE_DIR, SUNDIALS_LIBRARIES, SUNDIALS_VERSION.
#
# SUNDIALS' own SUNDIALSConfig.cmake is not asked: Debian's names shared libraries and MPI compilers, and stops the
# configuration where they are absent, as they are after `dpkg-deb -x` of libsundials-dev. Looks where find_package looks:
# SUNDIALS_ROOT, CMAKE_PREFIX_PATH, the system.

unset(SUNDIALS_INCLUDE_DIR)
unset(SUNDIALS_LIBRARIES)
unset(SUNDIALS_VERSION)
find_path(SUNDIALS_INCLUDE_DIR cvode/cvode.h NO_CACHE)

if(SUNDIALS_INCLUDE_DIR AND EXISTS "${SUNDIALS_INCLUDE_DIR}/sundials/sundials_config.h")
  file(STRINGS "${SUNDIALS_INCLUDE_DIR}/sundials/sundials_config.h" version_line REGEX "^#define SUNDIALS_VERSION \"")
  string(REGEX REPLACE "^[^\"]*\"([0-9.]+).*" "\\1" SUNDIALS_VERSION "${version_line}")
endif()

# What every other part needs became sundials_core in version 7; before, it was sundials_generic.
foreach(alternatives IN ITEMS cvode nvecserial "core generic")
  set(names "")
  separate_arguments(alternatives)
  foreach(part IN LISTS alternatives)
    list(APPEND names "${CMAKE_STATIC_LIBRARY_PREFIX}sundials_${part}${CMAKE_STATIC_LIBRARY_SUFFIX}"
                      "${CMAKE_STATIC_LIBRARY_PREFIX}sundials_${part}_static${CMAKE_STATIC_LIBRARY_SUFFIX}")
  endforeach()
  unset(library)
  find_library(library NAMES ${names} NO_CACHE)
  if(NOT library)
    set(SUNDIALS_LIBRARIES NOTFOUND)
    break()
  endif()
  list(APPEND SUNDIALS_LIBRARIES "${library}")
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(SUNDIALS REQUIRED_VARS SUNDIALS_LIBRARIES SUNDIALS_INCLUDE_DIR
                                  VERSION_VAR SUNDIALS_VERSION HANDLE_VERSION_RANGE)
