# Compiles CVODE from a release of the SUNDIALS project while CMake configures, so that it is known whether there is one
# before anything that needs it is added. A failure is said, and ends nothing.

# The release's archive of CVODE alone. Its hash is the one that FMPy's build (native/build_cvode.py) checks it against.
set(tendonfmu_sundials_release 6.4.1)
set(tendonfmu_sundials_url
    "https://github.com/LLNL/sundials/releases/download/v${tendonfmu_sundials_release}/cvode-${tendonfmu_sundials_release}.tar.gz")
set(tendonfmu_sundials_sha256 0a614e7d7d525d9ec88d5a30c887786d7c3681bd123bb6679fb9a4ec5f4609fe)

set(TENDONFMU_SUNDIALS_SOURCE "" CACHE STRING
    "Sources of SUNDIALS or CVODE to compile instead of release ${tendonfmu_sundials_release}: folder or archive on this machine")

# tendonfmu_build_sundials(FOLDER INSTALLED PROBLEM): works in FOLDER; sets INSTALLED to the folder of the result, or to
# nothing and PROBLEM to one line.
function(tendonfmu_build_sundials folder installed problem)
  set(${installed} "" PARENT_SCOPE)
  # One result for each compiler and target; what another build folder made is taken over.
  string(JOIN ";" key "${tendonfmu_sundials_release}" "${TENDONFMU_SUNDIALS_SOURCE}" "${CMAKE_C_COMPILER}"
         "${CMAKE_C_COMPILER_VERSION}" "${CMAKE_C_COMPILER_TARGET}" "${CMAKE_SYSTEM_NAME}" "${CMAKE_SYSTEM_PROCESSOR}"
         "${CMAKE_TOOLCHAIN_FILE}" "${CMAKE_OSX_ARCHITECTURES}" "${CMAKE_C_FLAGS}")
  string(SHA256 key "${key}")
  string(SUBSTRING "${key}" 0 12 key)
  set(result "${folder}/built-${key}")
  file(MAKE_DIRECTORY "${folder}")
  file(LOCK "${folder}" DIRECTORY GUARD FUNCTION TIMEOUT 600)
  if(NOT EXISTS "${result}/complete")
    set(failure "")
    tendonfmu_unpack_sundials("${folder}/source-${key}")
    if(NOT failure)
      tendonfmu_compile_sundials("${folder}/source-${key}" "${result}")
    endif()
    file(REMOVE_RECURSE "${folder}/source-${key}")
    if(failure)
      set(${problem} "${failure}" PARENT_SCOPE)
      return()
    endif()
    file(WRITE "${result}/complete" "")
  endif()
  set(${installed} "${result}" PARENT_SCOPE)
endfunction()

# Puts the sources into FOLDER/unpacked; sets `failure` in the caller if it cannot.
function(tendonfmu_unpack_sundials folder)
  file(REMOVE_RECURSE "${folder}")
  set(archive "${TENDONFMU_SUNDIALS_SOURCE}")
  if(IS_DIRECTORY "${archive}")
    file(COPY "${archive}/" DESTINATION "${folder}/unpacked")
    return()
  elseif(NOT archive)
    set(url "${tendonfmu_sundials_url}")
    set(archive "${folder}/cvode.tar.gz")
    message(STATUS "Downloading ${url}")
    # A byte first: where a firewall swallows requests, the whole would be waited for five minutes.
    file(DOWNLOAD "${url}" "${archive}" STATUS status TIMEOUT 20 TLS_VERIFY ON HTTPHEADER "Range: bytes=0-0")
    list(GET status 0 code)
    if(code EQUAL 0)
      # EXPECTED_HASH would end the configuration.
      file(DOWNLOAD "${url}" "${archive}" STATUS status INACTIVITY_TIMEOUT 15 TIMEOUT 600 TLS_VERIFY ON)
      list(GET status 0 code)
    endif()
    list(GET status 1 text)
    if(NOT code EQUAL 0)
      set(failure "${url} could not be fetched (${text})" PARENT_SCOPE)
      return()
    endif()
    file(SHA256 "${archive}" sha256)
    if(NOT sha256 STREQUAL tendonfmu_sundials_sha256)
      set(failure "${url} has SHA-256 ${sha256}, expected ${tendonfmu_sundials_sha256}" PARENT_SCOPE)
      return()
    endif()
  elseif(NOT EXISTS "${archive}")
    set(failure "TENDONFMU_SUNDIALS_SOURCE=${archive} does not exist" PARENT_SCOPE)
    return()
  endif()
  file(MAKE_DIRECTORY "${folder}/unpacked")
  # Not file(ARCHIVE_EXTRACT), which ends the configuration at a damaged archive.
  execute_process(COMMAND "${CMAKE_COMMAND}" -E tar xf "${archive}" WORKING_DIRECTORY "${folder}/unpacked"
                  RESULT_VARIABLE code OUTPUT_QUIET ERROR_QUIET)
  if(NOT code EQUAL 0)
    set(failure "${archive} could not be unpacked" PARENT_SCOPE)
  endif()
endfunction()

# Compiles FOLDER/unpacked and installs into RESULT; sets `failure` in the caller if it cannot.
function(tendonfmu_compile_sundials folder result)
  file(GLOB_RECURSE header "${folder}/unpacked/*/cvode.h")
  if(NOT header)
    set(failure "no sources of CVODE in ${TENDONFMU_SUNDIALS_SOURCE}" PARENT_SCOPE)
    return()
  endif()
  list(GET header 0 header)
  get_filename_component(source "${header}/../../.." ABSOLUTE)

  set(options -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DBUILD_SHARED_LIBS=OFF
              -DBUILD_STATIC_LIBS=ON -DENABLE_MPI=OFF -DENABLE_OPENMP=OFF -DENABLE_PTHREAD=OFF -DENABLE_LAPACK=OFF
              -DENABLE_KLU=OFF -DBUILD_FORTRAN_MODULE_INTERFACE=OFF -DEXAMPLES_ENABLE_C=OFF -DEXAMPLES_ENABLE_CXX=OFF
              -DEXAMPLES_INSTALL=OFF -DSUNDIALS_BUILD_WITH_PROFILING=OFF -DSUNDIALS_LOGGING_LEVEL=0
              -DCMAKE_INSTALL_LIBDIR=lib "-DCMAKE_INSTALL_PREFIX=${result}"
              # The project asks for a CMake so old that CMake 4 refuses parts of it.
              -DCMAKE_POLICY_VERSION_MINIMUM=3.5)
  foreach(package IN ITEMS ARKODE CVODES IDA IDAS KINSOL)
    list(APPEND options -DBUILD_${package}=OFF)
  endforeach()
  if(NOT MSVC)
    # As in CompileOptions.cmake.
    list(APPEND options "-DCMAKE_C_FLAGS=${CMAKE_C_FLAGS} -ffp-contract=off")
  endif()
  foreach(name IN ITEMS CMAKE_C_COMPILER CMAKE_C_COMPILER_TARGET CMAKE_TOOLCHAIN_FILE CMAKE_SYSTEM_NAME
                        CMAKE_SYSTEM_PROCESSOR CMAKE_OSX_ARCHITECTURES CMAKE_OSX_DEPLOYMENT_TARGET CMAKE_MAKE_PROGRAM)
    # CMAKE_SYSTEM_NAME on the command line would make a native build a cross-compilation.
    if(DEFINED ${name} AND NOT "${${name}}" STREQUAL "" AND (CMAKE_CROSSCOMPILING OR NOT name MATCHES "^CMAKE_SYSTEM_"))
      list(APPEND options "-D${name}=${${name}}")
    endif()
  endforeach()

  message(STATUS "Compiling CVODE (once)")
  set(log "${result}.log")
  foreach(step IN ITEMS "-S;${source};-B;${folder}/build;-G;${CMAKE_GENERATOR}" "--build;${folder}/build;--parallel"
                        "--install;${folder}/build")
    set(arguments ${step})
    if(step MATCHES "^-S")
      list(APPEND arguments ${options})
    elseif(step MATCHES "^--build")
      list(APPEND arguments --config Release)
    endif()
    execute_process(COMMAND "${CMAKE_COMMAND}" ${arguments} RESULT_VARIABLE code OUTPUT_FILE "${log}" ERROR_FILE "${log}")
    if(NOT code EQUAL 0)
      file(REMOVE_RECURSE "${result}")
      set(failure "CVODE could not be compiled (see ${log})" PARENT_SCOPE)
      return()
    endif()
  endforeach()
endfunction()
