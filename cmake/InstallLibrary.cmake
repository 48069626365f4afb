# Installs the C library: header, static libraries, CMake config package and pkg-config file.

if(NOT TARGET tendonfmu_core OR NOT TARGET tendonfmu_description)
  return()
endif()

include(CMakePackageConfigHelpers)

set_target_properties(tendonfmu_core PROPERTIES EXPORT_NAME tendonfmu OUTPUT_NAME tendonfmu)
set_target_properties(tendonfmu_description PROPERTIES EXPORT_NAME description)

install(TARGETS tendonfmu_core tendonfmu_description EXPORT tendonfmuTargets
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}/runtime/include/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp" PATTERN "tendonfmu_plant.h" EXCLUDE)
# The simulated finger's interface, for those who link it inside a build that takes this project by add_subdirectory. Its
# library is not exported: it needs SUNDIALS from where this build found it, a folder that an installation may not have.
if(TARGET tendonfmu_plant)
  install(FILES "${CMAKE_CURRENT_SOURCE_DIR}/runtime/include/tendonfmu_plant.h" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
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
foreach(name IN ITEMS tendonfmu tendonfmu-description)
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
