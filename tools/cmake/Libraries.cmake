# The libraries that are installed: a static library of the modules that a game server embeds, and one for CD nodes in
# other processes. The modules worlds and reference, the tools and the tests are not part of them. Install.cmake has what
# else is installed.

set(embedded base telemetry geometry link messages regions broad_phase narrow_phase queries motion nodes facade)
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
      message(FATAL_ERROR "Module ${module} links ${link}: add it to tools/cmake/Libraries.cmake, ringfence-config.cmake.in "
                          "and ringfence.pc.in, or a consumer cannot link the installed library")
    endif()
  endforeach()
endforeach()

include(GNUInstallDirs)
target_include_directories(ringfence_library INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/engine/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)

# A second library for journals.
if(RINGFENCE_HAS_JOURNAL)
  add_library(ringfence_journal_library STATIC $<TARGET_OBJECTS:ringfence_journal>)
  add_library(ringfence::journal ALIAS ringfence_journal_library)
  set_target_properties(ringfence_journal_library PROPERTIES OUTPUT_NAME ringfence_journal EXPORT_NAME journal)
  target_compile_features(ringfence_journal_library PUBLIC cxx_std_20)
  target_link_libraries(ringfence_journal_library PUBLIC ringfence_library PRIVATE PkgConfig::SQLITE PkgConfig::ZSTD)
endif()

# A third library for clients over the network.
if(RINGFENCE_HAS_GATEWAY)
  add_library(ringfence_gateway_library STATIC $<TARGET_OBJECTS:ringfence_gateway>)
  add_library(ringfence::gateway ALIAS ringfence_gateway_library)
  set_target_properties(ringfence_gateway_library PROPERTIES OUTPUT_NAME ringfence_gateway EXPORT_NAME gateway)
  target_compile_features(ringfence_gateway_library PUBLIC cxx_std_20)
  target_link_libraries(ringfence_gateway_library
    PUBLIC ringfence_library PRIVATE OpenSSL::SSL OpenSSL::Crypto PkgConfig::JWT)
endif()

# A fourth library for CD nodes in other processes.
if(RINGFENCE_HAS_DDS)
  add_library(ringfence_dds_library STATIC
    $<TARGET_OBJECTS:ringfence_dds> $<TARGET_OBJECTS:ringfence_dds_wire_objects>)
  add_library(ringfence::dds ALIAS ringfence_dds_library)
  set_target_properties(ringfence_dds_library PROPERTIES OUTPUT_NAME ringfence_dds EXPORT_NAME dds LINKER_LANGUAGE CXX)
  target_compile_features(ringfence_dds_library PUBLIC cxx_std_20)
  target_link_libraries(ringfence_dds_library PUBLIC ringfence_library PRIVATE CycloneDDS::ddsc)
endif()
