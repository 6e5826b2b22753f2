# What `cmake --install` gives: the program, the headers and one static library a room, as Berth::<room>, and what
# cmake/Package.cmake adds; see
# BerthConfig.cmake.in for who needs which packages.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# For `berth study` and the tests alone: no room that is installed links them, and no program of others' needs them.
set(BERTH_ROOMS_INSIDE harness campaign)
set(BERTH_INSTALLED_ROOMS ${BERTH_ROOMS})
list(REMOVE_ITEM BERTH_INSTALLED_ROOMS ${BERTH_ROOMS_INSIDE})

# Of a build of the program alone (./run demo) nothing is installed, rather than the half of it.
set(BERTH_INSTALLED "$<TARGET_FILE:berth>")
foreach(room IN LISTS BERTH_INSTALLED_ROOMS)
  list(APPEND BERTH_INSTALLED "$<TARGET_FILE:berth_${room}>")
endforeach()
install(CODE "
foreach(file IN ITEMS ${BERTH_INSTALLED})
  if(NOT EXISTS \"\${file}\")
    message(FATAL_ERROR \"Nothing is installed: this is not built: \${file}\nBuild all of it first: cmake --build ${PROJECT_BINARY_DIR}\")
  endif()
endforeach()" ALL_COMPONENTS)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/Berth)
set(BERTH_PACKAGE_LINKS "")
foreach(room IN LISTS BERTH_INSTALLED_ROOMS)
  set_target_properties(berth_${room} PROPERTIES EXPORT_NAME ${room})
  target_include_directories(berth_${room} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(berth_${room} INTERFACE cxx_std_20)
  install(TARGETS berth_${room} EXPORT BerthTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    COMPONENT development)
  string(APPEND BERTH_PACKAGE_LINKS "set(_berth_links_${room} ${BERTH_LINKS_${room}})\n")
endforeach()
install(TARGETS berth RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
set(inside "")
foreach(room IN LISTS BERTH_ROOMS_INSIDE)
  list(APPEND inside PATTERN berth/${room} EXCLUDE)
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/berth/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/berth
  COMPONENT development FILES_MATCHING PATTERN "*.hpp" PATTERN "*.h" ${inside})
install(EXPORT BerthTargets NAMESPACE Berth:: DESTINATION ${package} COMPONENT development)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/BerthConfig.cmake.in ${PROJECT_BINARY_DIR}/BerthConfig.cmake
  INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/BerthConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/BerthConfig.cmake ${PROJECT_BINARY_DIR}/BerthConfigVersion.cmake
  DESTINATION ${package} COMPONENT development)

# tests/install installs this build and builds a project against it.
if(TARGET test_install)
  foreach(room IN LISTS BERTH_INSTALLED_ROOMS)
    add_dependencies(test_install berth_${room})
  endforeach()
  get_target_property(flags berth_sanitize_link INTERFACE_LINK_OPTIONS)
  if(NOT flags)
    set(flags "")
  endif()
  string(REPLACE ";" " " flags "${flags}")
  string(REPLACE ";" " " rooms "${BERTH_INSTALLED_ROOMS}")
  string(REPLACE ";" " " inside "${BERTH_ROOMS_INSIDE}")
  target_compile_definitions(test_install PRIVATE BERTH_CMAKE="${CMAKE_COMMAND}" BERTH_CXX="${CMAKE_CXX_COMPILER}"
    BERTH_BUILD="${PROJECT_BINARY_DIR}" BERTH_LINK_FLAGS="${flags}" BERTH_ROOMS="${rooms}"
    BERTH_ROOMS_INSIDE="${inside}"
    BERTH_GENERATOR="${CMAKE_GENERATOR}")
endif()
