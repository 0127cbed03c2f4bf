# Debian packages by CPack, one for each component of Install.cmake. tools/package makes them.

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME ringfence)
set(CPACK_PACKAGE_VENDOR "The Ringfence authors")
set(CPACK_PACKAGE_CONTACT "The Ringfence authors" CACHE STRING "Maintainer of the Debian packages: NAME <ADDRESS>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL development)
if(TARGET ringfence_program)
  list(APPEND CPACK_COMPONENTS_ALL program)
endif()
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME ringfence)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION games)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "The program: runs and replays worlds with thousands of moving bodies,
checks their contacts against brute force, and measures how they scale.")

# A static library records no dependencies, so dpkg-shlibdeps cannot find those of its users. They are the packages of
# the libraries in ringfence-config.cmake.in and ringfence.pc.in.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libringfence-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libtbb-dev, libccd-dev, libhwy-dev, libhwloc-dev, pkgconf | pkg-config")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "libeigen3-dev, ringfence")
set(recommended)
if(RINGFENCE_HAS_JOURNAL)
  list(APPEND recommended libsqlite3-dev libzstd-dev)
endif()
if(RINGFENCE_HAS_GATEWAY)
  list(APPEND recommended libssl-dev libjwt-dev)
endif()
if(RINGFENCE_HAS_DDS)
  list(APPEND recommended cyclonedds-dev)
endif()
list(JOIN recommended ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "The static library and its headers for servers in C++20, with package
files for CMake and pkg-config.")

include(CPack)
