# Finds or builds SUNDIALS 6 or 7 (CVODE only, static, position-independent, without MPI) for the simulated finger.
#
#   tendonfmu_sundials           INTERFACE target with headers and libraries; exists only where SUNDIALS was found
#   TENDONFMU_SUNDIALS_VERSION   its version
#   TENDONFMU_SUNDIALS_MISSING   why there is none: one line
#
# Looked for in this order; the first that a small program can be linked with (sundials_check.c) is taken:
#   1. the folder TENDONFMU_SUNDIALS_ROOT (an installation, or a libsundials-dev unpacked by `dpkg-deb -x`): if it is set,
#      no other installation is looked at
#   2. where find_package looks: CMAKE_PREFIX_PATH, SUNDIALS_ROOT, the system
#   3. build/sundials/package, where tools/setup.sh unpacks Debian's libsundials-dev (TENDONFMU_SUNDIALS_FOLDER: build/sundials)
#   4. with TENDONFMU_FETCH_SUNDIALS, a release of the SUNDIALS project, compiled here (SundialsSource.cmake)

set(TENDONFMU_SUNDIALS_ROOT "" CACHE PATH "Folder of the SUNDIALS installation to use, and no other")
option(TENDONFMU_FETCH_SUNDIALS "Compile a release of SUNDIALS where no installed one is usable" ON)

# Beside all build folders, so that each of them finds what one of them fetched; as a part of another project, inside ours.
if(PROJECT_IS_TOP_LEVEL)
  set(default_folder "${PROJECT_SOURCE_DIR}/build/sundials")
else()
  set(default_folder "${PROJECT_BINARY_DIR}/sundials")
endif()
set(TENDONFMU_SUNDIALS_FOLDER "${default_folder}" CACHE PATH "Folder of the unpacked, or here compiled, SUNDIALS")

include(CheckLinkerFlag)

# Links the check into a shared library that may leave nothing undefined. Sets `problem` in the caller: empty if usable.
function(tendonfmu_check_sundials)
  set(subject "${SUNDIALS_INCLUDE_DIR};${SUNDIALS_LIBRARIES};${SUNDIALS_VERSION};${CMAKE_C_COMPILER}")
  if(NOT TENDONFMU_SUNDIALS_CHECKED STREQUAL subject)
    set(as_shared_library "")
    if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
      set(as_shared_library COMPILE_DEFINITIONS -fPIC LINK_OPTIONS -shared -Wl,-z,defs)
    endif()
    try_compile(usable "${PROJECT_BINARY_DIR}/sundials_check" SOURCES "${PROJECT_SOURCE_DIR}/cmake/sundials_check.c"
                CMAKE_FLAGS "-DINCLUDE_DIRECTORIES=${SUNDIALS_INCLUDE_DIR}" ${as_shared_library}
                LINK_LIBRARIES ${SUNDIALS_LIBRARIES} $<$<BOOL:${UNIX}>:m> OUTPUT_VARIABLE output)
    if(NOT usable)
      file(WRITE "${PROJECT_BINARY_DIR}/sundials_check.log" "${output}")
      # An archive's code for several processes: Debian's and Homebrew's of version 7.
      if(output MATCHES "mpi\\.h|MPI_Comm")
        set(problem "is built for MPI" PARENT_SCOPE)
      else()
        set(problem "cannot be linked into a shared library (see ${PROJECT_BINARY_DIR}/sundials_check.log)" PARENT_SCOPE)
      endif()
      return()
    endif()
    set(TENDONFMU_SUNDIALS_CHECKED "${subject}" CACHE INTERNAL "SUNDIALS that the check was linked with")
  endif()
  set(problem "" PARENT_SCOPE)
endfunction()

# The target for what FindSUNDIALS found. cmake/InstallLibrary.cmake puts copies of the archives beside an installed library.
function(tendonfmu_add_sundials_target)
  add_library(tendonfmu_sundials INTERFACE)
  target_include_directories(tendonfmu_sundials SYSTEM INTERFACE "$<BUILD_INTERFACE:${SUNDIALS_INCLUDE_DIR}>")
  set(names "")
  foreach(library IN LISTS SUNDIALS_LIBRARIES)
    get_filename_component(name "${library}" NAME)
    list(APPEND names "${name}")
    target_link_libraries(tendonfmu_sundials INTERFACE
      "$<BUILD_INTERFACE:${library}>" "$<INSTALL_INTERFACE:$<INSTALL_PREFIX>/${CMAKE_INSTALL_LIBDIR}/tendonfmu/${name}>")
  endforeach()
  target_link_libraries(tendonfmu_sundials INTERFACE $<$<BOOL:${UNIX}>:m>)
  set_target_properties(tendonfmu_sundials PROPERTIES TENDONFMU_ARCHIVES "${SUNDIALS_LIBRARIES}")

  # A simulator with a SUNDIALS of its own would otherwise have our calls bound to that one, of whatever version.
  string(JOIN ":" names ${names})
  check_linker_flag(C "LINKER:--exclude-libs,${names}" TENDONFMU_LINKER_HIDES_LIBRARIES)
  if(TENDONFMU_LINKER_HIDES_LIBRARIES)
    target_link_options(tendonfmu_sundials INTERFACE "LINKER:--exclude-libs,${names}")
  endif()
endfunction()

# Makes the target from what is in `folder`, or from what find_package finds if that is empty; notes in the caller's
# `problems` why not.
macro(tendonfmu_take_sundials folder)
  tendonfmu_find_sundials("${folder}")
  if(found_problem)
    list(APPEND problems "${found_problem}")
  endif()
endmacro()

function(tendonfmu_find_sundials folder)
  set(found_problem "" PARENT_SCOPE)
  if(folder)
    set(SUNDIALS_ROOT "${folder}" "${folder}/usr")
    foreach(place IN ITEMS CMAKE_PATH CMAKE_ENVIRONMENT_PATH CMAKE_SYSTEM_PATH SYSTEM_ENVIRONMENT_PATH)
      set(CMAKE_FIND_USE_${place} OFF)
    endforeach()
  endif()
  find_package(SUNDIALS MODULE QUIET)
  if(NOT SUNDIALS_FOUND)
    if(folder AND EXISTS "${folder}")
      set(found_problem "no static libraries of CVODE in ${folder}" PARENT_SCOPE)
    endif()
    return()
  endif()
  if(SUNDIALS_VERSION VERSION_LESS 6 OR SUNDIALS_VERSION VERSION_GREATER_EQUAL 8)
    set(problem "is not of version 6 or 7")
  else()
    tendonfmu_check_sundials()
  endif()
  if(problem)
    set(found_problem "SUNDIALS ${SUNDIALS_VERSION} in ${SUNDIALS_INCLUDE_DIR} ${problem}" PARENT_SCOPE)
    return()
  endif()
  tendonfmu_add_sundials_target()
  set(TENDONFMU_SUNDIALS_VERSION "${SUNDIALS_VERSION}" PARENT_SCOPE)
  message(STATUS "SUNDIALS ${SUNDIALS_VERSION}: ${SUNDIALS_INCLUDE_DIR}")
endfunction()

set(problems "")
if(TENDONFMU_SUNDIALS_ROOT)
  tendonfmu_take_sundials("${TENDONFMU_SUNDIALS_ROOT}")
else()
  tendonfmu_take_sundials("")
  if(NOT TARGET tendonfmu_sundials)
    tendonfmu_take_sundials("${TENDONFMU_SUNDIALS_FOLDER}/package")
  endif()
endif()

if(NOT TARGET tendonfmu_sundials AND TENDONFMU_FETCH_SUNDIALS)
  include(SundialsSource)
  tendonfmu_build_sundials("${TENDONFMU_SUNDIALS_FOLDER}" built_folder source_problem)
  if(built_folder)
    tendonfmu_take_sundials("${built_folder}")
  else()
    list(APPEND problems "${source_problem}")
  endif()
endif()

if(NOT TARGET tendonfmu_sundials)
  list(INSERT problems 0 "SUNDIALS 6 or 7 not found")
  string(REPLACE ";" "; " TENDONFMU_SUNDIALS_MISSING "${problems}")
endif()
