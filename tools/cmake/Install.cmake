# What is installed, by component:
#   program      the program, its man page and completion, and the recorded air traffic as an example
#   development  the libraries, their headers, and package files for CMake and pkg-config
# The target `installed` builds all of it, and nothing else.

include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/ringfence)
configure_package_config_file(${PROJECT_SOURCE_DIR}/tools/cmake/ringfence-config.cmake.in
  ${PROJECT_BINARY_DIR}/package/ringfence-config.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/ringfence-config-version.cmake
  COMPATIBILITY SameMinorVersion)
# Distributions may set absolute install directories; otherwise the .pc files are relocatable.
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_LIBDIR BASE_DIRECTORY "\${prefix}" OUTPUT_VARIABLE pc_libdir)
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_INCLUDEDIR BASE_DIRECTORY "\${prefix}" OUTPUT_VARIABLE pc_includedir)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig
  OUTPUT_VARIABLE pc_prefix)
set(pc_files ringfence.pc)
if(RINGFENCE_HAS_JOURNAL)
  list(APPEND pc_files ringfence-journal.pc)
endif()
if(RINGFENCE_HAS_GATEWAY)
  list(APPEND pc_files ringfence-gateway.pc)
endif()
if(RINGFENCE_HAS_DDS)
  list(APPEND pc_files ringfence-dds.pc)
endif()
foreach(file ${pc_files})
  configure_file(${PROJECT_SOURCE_DIR}/tools/cmake/${file}.in ${PROJECT_BINARY_DIR}/package/${file} @ONLY)
endforeach()

# Off by default if another project adds this one as a subdirectory: that project decides what it installs.
option(RINGFENCE_INSTALL "Install the libraries with headers and package files, and the program" ${PROJECT_IS_TOP_LEVEL})
if(NOT RINGFENCE_INSTALL)
  return()
endif()

add_custom_target(installed DEPENDS ringfence_library)
install(TARGETS ringfence_library EXPORT ringfence-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(EXPORT ringfence-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
set(headers_of_journal PATTERN journal.hpp EXCLUDE)
if(RINGFENCE_HAS_JOURNAL)
  set(headers_of_journal)
  add_dependencies(installed ringfence_journal_library)
  install(TARGETS ringfence_journal_library EXPORT ringfence-journal-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(EXPORT ringfence-journal-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
endif()
set(headers_of_gateway PATTERN gateway.hpp EXCLUDE)
if(RINGFENCE_HAS_GATEWAY)
  set(headers_of_gateway)
  add_dependencies(installed ringfence_gateway_library)
  install(TARGETS ringfence_gateway_library EXPORT ringfence-gateway-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(EXPORT ringfence-gateway-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
endif()
set(headers_of_dds PATTERN cluster.hpp EXCLUDE)
if(RINGFENCE_HAS_DDS)
  set(headers_of_dds)
  add_dependencies(installed ringfence_dds_library)
  install(TARGETS ringfence_dds_library EXPORT ringfence-dds-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(EXPORT ringfence-dds-targets NAMESPACE ringfence:: DESTINATION ${package_dir} COMPONENT development)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/engine/include/ringfence DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  COMPONENT development FILES_MATCHING PATTERN "*.hpp"
  ${headers_of_dds} ${headers_of_gateway} ${headers_of_journal})
install(FILES ${PROJECT_BINARY_DIR}/package/ringfence-config.cmake
  ${PROJECT_BINARY_DIR}/package/ringfence-config-version.cmake
  DESTINATION ${package_dir} COMPONENT development)
list(TRANSFORM pc_files PREPEND ${PROJECT_BINARY_DIR}/package/)
install(FILES ${pc_files} DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libringfence-dev
  RENAME copyright COMPONENT development)

if(TARGET ringfence_program)
  add_dependencies(installed ringfence_program)
  install(TARGETS ringfence_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
  get_property(helpers GLOBAL PROPERTY ringfence_helpers)
  add_dependencies(installed ${helpers})
  install(TARGETS ${helpers} RUNTIME DESTINATION libexec/ringfence COMPONENT program
    LIBRARY DESTINATION libexec/ringfence COMPONENT program)
  # The target ringfence_help generates both from the help of the program.
  if(TARGET ringfence_help)
    add_dependencies(installed ringfence_help)
    get_property(man_page GLOBAL PROPERTY ringfence_man_page)
    get_property(bash_completion GLOBAL PROPERTY ringfence_bash_completion)
    install(FILES ${man_page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 RENAME ringfence.1 COMPONENT program)
    install(FILES ${bash_completion} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
      RENAME ringfence COMPONENT program)
  endif()
  if(TARGET ringfence_web)
    add_dependencies(installed ringfence_web)
    install(DIRECTORY ${PROJECT_BINARY_DIR}/share/ringfence/web DESTINATION ${CMAKE_INSTALL_DATADIR}/ringfence
      COMPONENT program)
  endif()
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/data/air DESTINATION ${CMAKE_INSTALL_DATADIR}/ringfence
    COMPONENT program)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/ringfence
    RENAME copyright COMPONENT program)
endif()

include(${PROJECT_SOURCE_DIR}/tools/cmake/Debian.cmake)
