# The pages, and the files that they tell people to use, as far as they are text. Programs, units and manual pages name
# them as they are called in the repository, for example client/sim/README.md: this is
# share/doc/PACKAGE/client/sim/README.md. Each package has all of them (0.1 MB), so that the links between them work,
# whichever package is installed. tests/deploy/named_pages.sh checks both.
set(patterns client/*.md deploy/*.md deploy/monitoring/*.json deploy/monitoring/*.yml deploy/security/*.sh idl/*.md
  idl/*.idl idl/*.proto server/*.md)
list(TRANSFORM patterns PREPEND ${CMAKE_SOURCE_DIR}/)
file(GLOB_RECURSE CAIRN_PAGES CONFIGURE_DEPENDS RELATIVE ${CMAKE_SOURCE_DIR} ${patterns})
list(APPEND CAIRN_PAGES README.md deploy/cairnd.yaml)

function(cairn_install_pages component package)
  foreach(page IN LISTS CAIRN_PAGES)
    get_filename_component(folder ${page} DIRECTORY)
    install(FILES ${CMAKE_SOURCE_DIR}/${page} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}/${folder}
      COMPONENT ${component})
  endforeach()
endfunction()
