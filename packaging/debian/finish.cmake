# CPack calls it when the files of all packages are in their folders: what Debian's policy wants of them.

set(epoch "$ENV{SOURCE_DATE_EPOCH}")
file(GLOB components LIST_DIRECTORIES true ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/*)
set(package_program berth)
set(package_development libberth-dev)
set(package_documentation berth-doc)

foreach(component IN LISTS components)
  get_filename_component(name ${component} NAME)
  set(package ${package_${name}})
  if(NOT package)
    message(FATAL_ERROR "packaging/debian/finish.cmake knows no package for ${component}")
  endif()
  set(doc ${component}/usr/share/doc/${package})
  # Not file(INSTALL), which would put DESTDIR before the place.
  file(COPY ${CPACK_BERTH_PACKAGING}/debian/copyright ${CPACK_BERTH_PACKAGING}/debian/changelog DESTINATION ${doc}
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
  set(overrides ${CPACK_BERTH_PACKAGING}/debian/${package}.lintian-overrides)
  if(EXISTS ${overrides})
    file(MAKE_DIRECTORY ${component}/usr/share/lintian/overrides)
    file(COPY_FILE ${overrides} ${component}/usr/share/lintian/overrides/${package})
  endif()

  file(GLOB_RECURSE compressed ${component}/usr/share/man/*.1)
  execute_process(COMMAND gzip -9n ${compressed} ${doc}/changelog COMMAND_ERROR_IS_FATAL ANY)

  # As dh_strip does it.
  file(GLOB_RECURSE libraries ${component}/usr/lib/*.a)
  foreach(library IN LISTS libraries)
    execute_process(COMMAND strip --strip-debug --remove-section=.comment --remove-section=.note
      --enable-deterministic-archives ${library} COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  foreach(program ${component}/usr/bin/berth)
    if(EXISTS ${program})
      execute_process(COMMAND strip --remove-section=.comment --remove-section=.note ${program}
        COMMAND_ERROR_IS_FATAL ANY)
    endif()
  endforeach()
endforeach()
