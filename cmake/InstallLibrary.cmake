# Installs the C libraries: headers, static libraries, CMake config package and pkg-config file.

if(NOT TARGET tendonfmu_core OR NOT TARGET tendonfmu_description)
  return()
endif()

include(CMakePackageConfigHelpers)

set_target_properties(tendonfmu_core PROPERTIES EXPORT_NAME tendonfmu OUTPUT_NAME tendonfmu)
set_target_properties(tendonfmu_description PROPERTIES EXPORT_NAME description)

install(TARGETS tendonfmu_core tendonfmu_description EXPORT tendonfmuTargets
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}/runtime/include/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp" PATTERN "tendonfmu_plant.h" EXCLUDE
        PATTERN "tendonfmu_estimation.hpp" EXCLUDE)

install(FILES LICENSE THIRD_PARTY_LICENSES.txt DESTINATION "${CMAKE_INSTALL_DOCDIR}")

# Users of a library need not link these of its own libraries.
function(tendonfmu_forget library)
  get_target_property(needed ${library} INTERFACE_LINK_LIBRARIES)
  list(REMOVE_ITEM needed ${ARGN})
  set_target_properties(${library} PROPERTIES INTERFACE_LINK_LIBRARIES "${needed}")
endfunction()

# The estimation of parameters, where it was built.
set(TENDONFMU_NEEDS_THREADS OFF)
if(TARGET tendonfmu_estimation)
  set(TENDONFMU_NEEDS_THREADS ON)
  set_target_properties(tendonfmu_estimation PROPERTIES EXPORT_NAME estimation)
  tendonfmu_forget(tendonfmu_estimation "$<LINK_ONLY:Eigen3::Eigen>") # header-only
  install(TARGETS tendonfmu_estimation EXPORT tendonfmuTargets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  install(FILES runtime/include/tendonfmu_estimation.hpp DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
endif()

# The simulated finger, where it was built, with the archives of SUNDIALS that it was linked with.
if(TARGET tendonfmu_plant)
  set_target_properties(tendonfmu_plant PROPERTIES EXPORT_NAME plant)
  set_target_properties(tendonfmu_sundials PROPERTIES EXPORT_NAME sundials)
  # Header-only: those who link the installed library do not need them.
  tendonfmu_forget(tendonfmu_plant "$<LINK_ONLY:nlohmann_json::nlohmann_json>" "$<LINK_ONLY:Eigen3::Eigen>")
  install(TARGETS tendonfmu_plant tendonfmu_sundials EXPORT tendonfmuTargets
          ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
  install(FILES runtime/include/tendonfmu_plant.h DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
  get_target_property(archives tendonfmu_sundials TENDONFMU_ARCHIVES)
  install(FILES ${archives} DESTINATION "${CMAKE_INSTALL_LIBDIR}/tendonfmu")
endif()

set(config_folder "${CMAKE_INSTALL_LIBDIR}/cmake/tendonfmu")
install(EXPORT tendonfmuTargets NAMESPACE tendonfmu:: DESTINATION "${config_folder}")
configure_package_config_file(cmake/tendonfmuConfig.cmake.in tendonfmuConfig.cmake INSTALL_DESTINATION "${config_folder}")
write_basic_package_version_file(tendonfmuConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/tendonfmuConfig.cmake" "${CMAKE_CURRENT_BINARY_DIR}/tendonfmuConfigVersion.cmake"
        DESTINATION "${config_folder}")

# Paths relative to the file itself, so that the installed folder may be moved.
file(RELATIVE_PATH pc_prefix "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
string(REGEX REPLACE "/$" "" pc_prefix "${pc_prefix}")
# A C program links with the C++ runtime of the compiler that made the description library.
if(CMAKE_CXX_COMPILER_ID STREQUAL "AppleClang")
  set(pc_cxx_runtime "-lc++")
else()
  set(pc_cxx_runtime "-lstdc++")
endif()
set(pc_names tendonfmu tendonfmu-description)
if(TARGET tendonfmu_estimation)
  list(APPEND pc_names tendonfmu-estimation)
endif()
if(TARGET tendonfmu_plant)
  list(APPEND pc_names tendonfmu-plant)
  list(TRANSFORM archives REPLACE ".*/" "\${libdir}/tendonfmu/" OUTPUT_VARIABLE pc_archives)
  string(JOIN " " pc_archives ${pc_archives})
endif()
foreach(name IN LISTS pc_names)
  configure_file(cmake/${name}.pc.in ${name}.pc @ONLY)
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/${name}.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
endforeach()

# The same names inside a build that takes the project by add_subdirectory.
if(NOT TARGET tendonfmu::tendonfmu)
  add_library(tendonfmu::tendonfmu ALIAS tendonfmu_core)
endif()
if(NOT TARGET tendonfmu::description)
  add_library(tendonfmu::description ALIAS tendonfmu_description)
endif()
if(TARGET tendonfmu_estimation AND NOT TARGET tendonfmu::estimation)
  add_library(tendonfmu::estimation ALIAS tendonfmu_estimation)
endif()
if(TARGET tendonfmu_plant AND NOT TARGET tendonfmu::plant)
  add_library(tendonfmu::plant ALIAS tendonfmu_plant)
endif()
