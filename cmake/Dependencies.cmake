# Finds what the parts need and says plainly what is missing.
#
#   nlohmann_json::nlohmann_json   reads the finger description (runtime/description); from the system or, as Eigen,
#                                  from a Python package
#   Python_EXECUTABLE              runs the generators; with TENDONFMU_PYTHON also the headers of extension modules
#   TENDONFMU_FMI_INCLUDE_DIR      folder of fmi2Functions.h, taken from the installed Python package fmpy
#   tendonfmu_fmi_headers          the same as an INTERFACE target
#   GTest::gtest_main              with TENDONFMU_BUILD_TESTS
#   benchmark::benchmark_main      with TENDONFMU_BUILD_BENCH
#   TENDONFMU_HAS_PLANT            the simulated finger can be built: then also the targets tendonfmu_sundials and Eigen3::Eigen
#   TENDONFMU_HAS_ESTIMATION       parameters can be estimated: then also the targets Eigen3::Eigen and Threads::Threads

option(TENDONFMU_HEADERS_FROM_PYTHON "Take nlohmann-json and Eigen from Python packages, even where the system has them" OFF)
set(TENDONFMU_HEADERS_PYTHON "" CACHE FILEPATH "Python that has these packages; default: the one that is built for")

if(TENDONFMU_PYTHON)
  # scikit-build-core names the component of the stable interface where the wheel is to have it (wheel.py-api in pyproject.toml).
  find_package(Python 3.10 REQUIRED COMPONENTS Interpreter Development.Module ${SKBUILD_SABI_COMPONENT})
elseif(TENDONFMU_BUILD_FMU)
  find_package(Python 3.10 REQUIRED COMPONENTS Interpreter)
endif()

# Sets `folder` to PATH in the site-packages of the installed Python distribution NAME, or to nothing. Nothing is imported:
# fmpy's import takes half a second.
function(tendonfmu_python_folder folder name path)
  set(found "")
  set(interpreter "${Python_EXECUTABLE}")
  if(TENDONFMU_HEADERS_PYTHON)
    # -I: pip's PYTHONPATH, by which a build finds its own packages, is not for another interpreter.
    set(interpreter "${TENDONFMU_HEADERS_PYTHON}" -I)
  endif()
  if(interpreter)
    execute_process(
      COMMAND ${interpreter} -c
              "import sys; from importlib.metadata import distribution; print(distribution(sys.argv[1]).locate_file(sys.argv[2]))"
              "${name}" "${path}"
      OUTPUT_VARIABLE found ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    file(TO_CMAKE_PATH "${found}" found)
  endif()
  set(${folder} "${found}" PARENT_SCOPE)
endfunction()

# Both are header-only. `pip install` of the source distribution brings them as Python packages (pyproject.toml).
if(NOT TENDONFMU_HEADERS_FROM_PYTHON)
  find_package(nlohmann_json 3.9 QUIET)
endif()
if(NOT TARGET nlohmann_json::nlohmann_json)
  tendonfmu_python_folder(json_folder nlohmann-json nlohmann_json/include)
  if(NOT EXISTS "${json_folder}/nlohmann/json.hpp")
    message(FATAL_ERROR "nlohmann-json >= 3.9 not found: install nlohmann-json3-dev (Debian, Ubuntu), nlohmann-json (Homebrew) "
                        "or the Python package nlohmann-json")
  endif()
  message(STATUS "nlohmann-json: ${json_folder}")
  add_library(nlohmann_json::nlohmann_json INTERFACE IMPORTED)
  target_include_directories(nlohmann_json::nlohmann_json SYSTEM INTERFACE "${json_folder}")
endif()

if(TENDONFMU_BUILD_FMU)
  if(NOT EXISTS "${TENDONFMU_FMI_INCLUDE_DIR}/fmi2Functions.h")
    tendonfmu_python_folder(fmi_folder fmpy fmpy/c-code)
    set(TENDONFMU_FMI_INCLUDE_DIR "${fmi_folder}" CACHE PATH "Folder of fmi2Functions.h" FORCE)
  endif()
  if(NOT EXISTS "${TENDONFMU_FMI_INCLUDE_DIR}/fmi2Functions.h")
    message(FATAL_ERROR "FMI headers not found: install the Python package fmpy for ${Python_EXECUTABLE}, "
                        "or set TENDONFMU_FMI_INCLUDE_DIR to the folder of fmi2Functions.h")
  endif()
  add_library(tendonfmu_fmi_headers INTERFACE)
  target_include_directories(tendonfmu_fmi_headers SYSTEM INTERFACE "${TENDONFMU_FMI_INCLUDE_DIR}")
endif()

if(TENDONFMU_BUILD_TESTS)
  find_package(GTest QUIET)
  if(NOT GTest_FOUND)
    message(FATAL_ERROR "GoogleTest not found: install libgtest-dev (Debian, Ubuntu) or googletest (Homebrew), "
                        "or configure with -DTENDONFMU_BUILD_TESTS=OFF")
  endif()
  include(GoogleTest)
endif()

if(TENDONFMU_BUILD_BENCH)
  find_package(benchmark QUIET)
  if(NOT benchmark_FOUND)
    message(FATAL_ERROR "Google Benchmark not found: install libbenchmark-dev (Debian, Ubuntu) or google-benchmark (Homebrew)")
  endif()
endif()

# For the simulated finger and the estimation of parameters: the rest is built without it.
set(eigen_missing "")
if(TENDONFMU_PLANT OR TENDONFMU_ESTIMATION)
  # Versions are compared here: Eigen 5 does not call itself compatible with 3.4, and is.
  if(NOT TENDONFMU_HEADERS_FROM_PYTHON)
    find_package(Eigen3 QUIET NO_MODULE)
  endif()
  if(NOT TARGET Eigen3::Eigen)
    tendonfmu_python_folder(eigen_folder cmeel-eigen cmeel.prefix)
    find_package(Eigen3 QUIET NO_MODULE PATHS "${eigen_folder}" NO_DEFAULT_PATH)
  endif()
  if(NOT TARGET Eigen3::Eigen OR Eigen3_VERSION VERSION_LESS 3.4)
    set(eigen_missing "Eigen >= 3.4 not found: install libeigen3-dev (Debian, Ubuntu), eigen (Homebrew) or the Python package cmeel-eigen")
  endif()
endif()

# Where the output of CMake is not shown, tools/setup.sh says from the files written here what is not built, and why.
set(TENDONFMU_HAS_ESTIMATION OFF)
set(estimation_missing "")
if(NOT TENDONFMU_ESTIMATION)
  set(estimation_missing "it is switched off (TENDONFMU_ESTIMATION)")
elseif(eigen_missing)
  set(estimation_missing "${eigen_missing}")
else()
  set(THREADS_PREFER_PTHREAD_FLAG ON)
  find_package(Threads QUIET)
  if(Threads_FOUND)
    set(TENDONFMU_HAS_ESTIMATION ON)
  else()
    set(estimation_missing "CMake found no threads for ${CMAKE_SYSTEM_NAME}")
  endif()
endif()
if(NOT TENDONFMU_HAS_ESTIMATION)
  message(NOTICE "The estimation of parameters is not built: ${estimation_missing}")
endif()
file(WRITE "${PROJECT_BINARY_DIR}/estimation_missing.txt" "${estimation_missing}")

set(TENDONFMU_HAS_PLANT OFF)
set(plant_missing "")
if(NOT TENDONFMU_PLANT)
  set(plant_missing "it is switched off (TENDONFMU_PLANT)")
elseif(MSVC)
  set(plant_missing "it needs the vector types of gcc and clang (runtime/plant/elementary.h)")
elseif(eigen_missing)
  set(plant_missing "${eigen_missing}")
else()
  include(Sundials)
  if(TARGET tendonfmu_sundials)
    set(TENDONFMU_HAS_PLANT ON)
  else()
    set(plant_missing "${TENDONFMU_SUNDIALS_MISSING}")
  endif()
endif()
if(NOT TENDONFMU_HAS_PLANT)
  message(NOTICE "The simulated finger is not built: ${plant_missing}")
endif()
file(WRITE "${PROJECT_BINARY_DIR}/simulated_finger_missing.txt" "${plant_missing}")
