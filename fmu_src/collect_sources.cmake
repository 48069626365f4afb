cmake_minimum_required(VERSION 3.22)

# Copies FILES (separated by bars) flat into FOLDER and writes FOLDER/sources.txt: the C files to compile, in order.
#
# finger.c wants the version on the command line, where a source FMU cannot give it; so finger_of_version.c, made here,
# defines it and includes finger.c, and stands in the list in its place.

string(REPLACE "|" ";" files "${FILES}")
file(REMOVE_RECURSE "${FOLDER}")
file(MAKE_DIRECTORY "${FOLDER}")
set(to_compile "")
foreach(path IN LISTS files)
  get_filename_component(name "${path}" NAME)
  if(EXISTS "${FOLDER}/${name}")
    if(NOT path IN_LIST copied)
      message(FATAL_ERROR "two sources of the name ${name}: a source FMU has one folder for all")
    endif()
    continue()
  endif()
  list(APPEND copied "${path}")
  configure_file("${path}" "${FOLDER}/${name}" COPYONLY)
  if(name STREQUAL "finger.c")
    set(name finger_of_version.c)
    file(WRITE "${FOLDER}/${name}" "#define TENDONFMU_VERSION \"${VERSION}\"\n#include \"finger.c\"\n")
  endif()
  if(name MATCHES "\\.c$")
    string(APPEND to_compile "${name}\n")
  endif()
endforeach()
file(WRITE "${FOLDER}/sources.txt" "${to_compile}")
