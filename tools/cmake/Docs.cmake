# The target `docs`: the pages of docs/ as a site in docs/ of the build directory, and the reference of the public headers
# by Doxygen in its folder api/. A warning of either tool fails the target. Packages: tools/setup docs.
find_program(RINGFENCE_DOXYGEN doxygen DOC "Doxygen, for the target docs")
find_program(RINGFENCE_MKDOCS mkdocs DOC "MkDocs, for the target docs")
if(NOT RINGFENCE_DOXYGEN OR NOT RINGFENCE_MKDOCS)
  message(STATUS "No target docs: install doxygen, mkdocs and mkdocs-material (tools/setup docs)")
  return()
endif()
set(RINGFENCE_DOCS_DIR ${PROJECT_BINARY_DIR}/docs)
configure_file(tools/docs/Doxyfile.in ${PROJECT_BINARY_DIR}/Doxyfile @ONLY)
add_custom_target(docs VERBATIM
  COMMAND ${CMAKE_COMMAND} -E env PYTHONDONTWRITEBYTECODE=1 RINGFENCE_DOCS_SOURCE=${PROJECT_SOURCE_DIR}/docs
    RINGFENCE_DOCS_SITE=${RINGFENCE_DOCS_DIR}
    ${RINGFENCE_MKDOCS} build --quiet --strict --config-file ${PROJECT_SOURCE_DIR}/tools/docs/mkdocs.yml
  COMMAND ${RINGFENCE_DOXYGEN} ${PROJECT_BINARY_DIR}/Doxyfile
  COMMENT "Building the site of the documentation in ${RINGFENCE_DOCS_DIR}")
