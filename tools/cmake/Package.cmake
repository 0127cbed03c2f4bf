# The installed package: a static library of the modules that a game server embeds, the public headers, and package files
# for CMake and pkg-config. The modules worlds and reference, the tools and the tests are not part of it.

set(embedded base telemetry geometry link messages regions broad_phase narrow_phase motion nodes facade)
set(link_targets Threads::Threads PkgConfig::CCD PkgConfig::HWY PkgConfig::HWLOC TBB::tbb)  # also in ringfence-config.cmake.in
set(header_only Eigen3::Eigen)

add_library(ringfence_library STATIC)
add_library(ringfence::ringfence ALIAS ringfence_library)
set_target_properties(ringfence_library PROPERTIES OUTPUT_NAME ringfence EXPORT_NAME ringfence)
target_compile_features(ringfence_library PUBLIC cxx_std_20)
target_link_libraries(ringfence_library PRIVATE Threads::Threads)

get_property(modules GLOBAL PROPERTY ringfence_modules)
foreach(module ${modules})
  if(NOT module IN_LIST embedded)
    continue()
  endif()
  target_sources(ringfence_library PRIVATE $<TARGET_OBJECTS:ringfence_${module}>)
  get_property(uses GLOBAL PROPERTY ringfence_modules_of_${module})
  foreach(used ${uses})
    if(NOT used IN_LIST embedded)
      message(FATAL_ERROR "Module ${module} uses ${used}, which is not part of the installed library")
    endif()
  endforeach()
  get_property(links GLOBAL PROPERTY ringfence_link_of_${module})
  foreach(link ${links})
    if(link IN_LIST link_targets)
      target_link_libraries(ringfence_library PRIVATE ${link})
    elseif(NOT link IN_LIST header_only)
      message(FATAL_ERROR "Module ${module} links ${link}: add it to tools/cmake/Package.cmake, ringfence-config.cmake.in "
                          "and ringfence.pc.in, or a consumer cannot link the installed library")
    endif()
  endforeach()
endforeach()

include(GNUInstallDirs)
target_include_directories(ringfence_library INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/engine/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)

# A second library for CD nodes in other processes.
if(RINGFENCE_HAS_DDS)
  add_library(ringfence_dds_library STATIC
    $<TARGET_OBJECTS:ringfence_dds> $<TARGET_OBJECTS:ringfence_dds_wire_objects>)
  add_library(ringfence::dds ALIAS ringfence_dds_library)
  set_target_properties(ringfence_dds_library PROPERTIES OUTPUT_NAME ringfence_dds EXPORT_NAME dds LINKER_LANGUAGE CXX)
  target_compile_features(ringfence_dds_library PUBLIC cxx_std_20)
  target_link_libraries(ringfence_dds_library PUBLIC ringfence_library PRIVATE CycloneDDS::ddsc)
endif()

include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/ringfence)
configure_package_config_file(${PROJECT_SOURCE_DIR}/tools/cmake/ringfence-config.cmake.in
  ${PROJECT_BINARY_DIR}/package/ringfence-config.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/ringfence-config-version.cmake
  COMPATIBILITY SameMinorVersion)
# Distributions may set absolute install directories; otherwise the .pc file is relocatable.
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_LIBDIR BASE_DIRECTORY "\${prefix}" OUTPUT_VARIABLE pc_libdir)
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_INCLUDEDIR BASE_DIRECTORY "\${prefix}" OUTPUT_VARIABLE pc_includedir)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig
  OUTPUT_VARIABLE pc_prefix)
configure_file(${PROJECT_SOURCE_DIR}/tools/cmake/ringfence.pc.in ${PROJECT_BINARY_DIR}/package/ringfence.pc @ONLY)

# Off by default if another project adds this one as a subdirectory: that project decides what it installs.
option(RINGFENCE_INSTALL "Install the library, its headers and package files" ${PROJECT_IS_TOP_LEVEL})
if(RINGFENCE_INSTALL)
  install(TARGETS ringfence_library EXPORT ringfence-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/engine/include/ringfence DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
    COMPONENT development FILES_MATCHING PATTERN "*.hpp")
  install(EXPORT ringfence-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
  if(RINGFENCE_HAS_DDS)
    install(TARGETS ringfence_dds_library EXPORT ringfence-dds-targets
      ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
    install(EXPORT ringfence-dds-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
  endif()
  install(FILES ${PROJECT_BINARY_DIR}/package/ringfence-config.cmake
    ${PROJECT_BINARY_DIR}/package/ringfence-config-version.cmake
    DESTINATION ${package_dir} COMPONENT development)
  install(FILES ${PROJECT_BINARY_DIR}/package/ringfence.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endif()
