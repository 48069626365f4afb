# Compiles every header by itself, twice included: what it needs it includes, and its guard holds. The headers of C are
# compiled as C and as C++, but for those of the kernels.
#
#   headers_alone(NAME LANGUAGE FOLDER [libraries])   the headers of a folder, as C or CXX, with the includes of libraries
function(headers_alone name language folder)
  if(language STREQUAL "C")
    set(suffix c)
  else()
    set(suffix cpp)
  endif()
  file(GLOB headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/${folder}/*.h")
  if(language STREQUAL "CXX")
    file(GLOB cpp_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/${folder}/*.hpp")
    list(APPEND headers ${cpp_headers})
  endif()
  set(sources)
  foreach(header IN LISTS headers)
    get_filename_component(stem "${header}" NAME_WE)
    get_filename_component(extension "${header}" LAST_EXT) # there are both tendonfmu.h and tendonfmu.hpp
    set(source "${CMAKE_CURRENT_BINARY_DIR}/headers_alone/${name}_${language}${extension}/${stem}.${suffix}")
    file(CONFIGURE OUTPUT "${source}" CONTENT "#include \"${header}\"\n#include \"${header}\"\n" @ONLY)
    if(stem STREQUAL "quad_avx2" AND NOT MSVC)
      set_source_files_properties("${source}" PROPERTIES COMPILE_OPTIONS -mavx2) # its user asks for it by a pragma
    endif()
    list(APPEND sources "${source}")
  endforeach()
  if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64|amd64")
    list(FILTER sources EXCLUDE REGEX "quad_(sse2|avx2)")
  endif()
  add_library(headers_alone_${name}_${language} OBJECT ${sources})
  target_include_directories(headers_alone_${name}_${language} PRIVATE "${PROJECT_SOURCE_DIR}/${folder}")
  target_link_libraries(headers_alone_${name}_${language} PRIVATE ${ARGN})
  if(NOT MSVC) # what a kernel's header defines, its one user uses
    target_compile_options(headers_alone_${name}_${language} PRIVATE -Wno-unused-function)
  endif()
endfunction()

foreach(language IN ITEMS C CXX)
  headers_alone(interface ${language} runtime/include)
  headers_alone(core ${language} runtime/core tendonfmu_core_inside)
  headers_alone(effects ${language} runtime/core/effects tendonfmu_core_inside)
  if(TENDONFMU_BUILD_FMU)
    headers_alone(fmu ${language} fmu_src tendonfmu_core tendonfmu_fmi_headers)
    headers_alone(plant_fmu ${language} fmu_src/plant_fmu tendonfmu_core tendonfmu_fmi_headers)
    foreach(part IN ITEMS fmu plant_fmu)
      target_include_directories(headers_alone_${part}_${language} PRIVATE "${PROJECT_SOURCE_DIR}/fmu_src"
                                                                           "${PROJECT_BINARY_DIR}/fmu_src/generated")
      add_dependencies(headers_alone_${part}_${language} tendonfmu_fmu) # which makes variable_table.h
    endforeach()
  endif()
endforeach()
headers_alone(kernel C runtime/core/kernel tendonfmu_core_inside) # the step alone includes them
headers_alone(description CXX runtime/description tendonfmu_core_inside nlohmann_json::nlohmann_json)
if(TARGET tendonfmu_estimation)
  headers_alone(estimation CXX runtime/estimation tendonfmu_core_inside Eigen3::Eigen)
  target_include_directories(headers_alone_estimation_CXX PRIVATE "${PROJECT_SOURCE_DIR}/runtime/description")
endif()
if(TENDONFMU_HAS_PLANT)
  headers_alone(plant CXX runtime/plant tendonfmu_description nlohmann_json::nlohmann_json Eigen3::Eigen
                tendonfmu_sundials)
  target_include_directories(headers_alone_plant_CXX PRIVATE "${PROJECT_SOURCE_DIR}/runtime/description")
endif()
