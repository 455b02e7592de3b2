# What `cmake --install` puts below a prefix: headers, the libraries duet::<room> and duet::duet, engines, shipped files, the
# program, and the packages that CMake and pkg-config find (docs/using-duet.md).
include(CMakePackageConfigHelpers)

# Rooms that others may link; app is for programs that add a part to `duet` (parts/CMakeLists.txt).
set(rooms ${DUET_ROOMS})
list(REMOVE_ITEM rooms app)
set(libraries ${rooms})
list(TRANSFORM libraries PREPEND duet_)
set(program_library "")
if(TARGET duet_app)
  set(program_library duet_app)
endif()

# The core and the rooms of parts are two components and two exports, so that the core can be installed alone.
set(core_libraries ${libraries})
set(part_libraries "")
foreach(part IN LISTS DUET_PARTS)
  foreach(room IN LISTS DUET_ROOMS_OF_${part})
    list(APPEND part_libraries duet_${room})
  endforeach()
endforeach()
list(REMOVE_ITEM core_libraries ${part_libraries})
add_library(duet_library INTERFACE)
target_link_libraries(duet_library INTERFACE ${core_libraries})
set_target_properties(duet_library PROPERTIES EXPORT_NAME duet)
add_library(duet::duet ALIAS duet_library)
install(TARGETS ${core_libraries} ${program_library} duet_library duet_options EXPORT duetTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/duet)
install(EXPORT duetTargets NAMESPACE duet:: DESTINATION ${package} COMPONENT library)
if(part_libraries)
  install(TARGETS ${part_libraries} EXPORT duetPartTargets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT parts)
  install(EXPORT duetPartTargets NAMESPACE duet:: DESTINATION ${package} COMPONENT parts)
endif()

# Headers that only files of their own room include: an engine's adapter, kernels, steps of one implementation.
set(internal "(^|/)(backends/(mujoco|bullet|ode|simbody|dart)|hardware/dds)/|motion/synthesis/(people_stage|render|stage)\\.h$|_parts\\.h$|kernels?_body\\.h$|/(kernel_(frame|ground|object)|lane_(problem|lbfgs)|(double_lbfgs|lbfgs_(memory|body)|pair_kernel))\\.h$|/network_engines\\.h$|/libtorch_peer\\.h$")
foreach(room IN LISTS rooms ITEMS app)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/${room}/*.h)
  list(FILTER headers EXCLUDE REGEX "${internal}")
  set(component library)
  if(duet_${room} IN_LIST part_libraries)
    set(component parts)
  endif()
  foreach(header IN LISTS headers)
    cmake_path(GET header PARENT_PATH folder)
    install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/duet/${folder} COMPONENT ${component})
  endforeach()
endforeach()

# What share_file finds (core/share.h): the same folders as in the tree.
foreach(folder robots controllers policies metrics profiles suites)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_DATADIR}/duet COMPONENT share
          FILES_MATCHING PATTERN "*.yaml" PATTERN "*.urdf" PATTERN "*.safetensors" PATTERN "*.sha256" PATTERN "test_split.txt")
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/backends/node DESTINATION ${CMAKE_INSTALL_DATADIR}/duet/backends COMPONENT share
        FILES_MATCHING PATTERN "*.mjs" PATTERN "*.json")
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT share)

get_property(engines GLOBAL PROPERTY DUET_ENGINE_TARGETS)
if(engines)
  install(TARGETS ${engines} LIBRARY DESTINATION ${DUET_ENGINES_FOLDER} COMPONENT program)
endif()
if(TARGET duet)
  install(TARGETS duet RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
  # The program writes its own manual page; one for another processor cannot be asked.
  if(NOT CMAKE_CROSSCOMPILING)
    set(manual ${PROJECT_BINARY_DIR}/package/duet.1)
    add_custom_command(OUTPUT ${manual} COMMAND sh -c "'$<TARGET_FILE:duet>' man >'${manual}'" DEPENDS duet VERBATIM)
    add_custom_target(duet_manual ALL DEPENDS ${manual})
    install(FILES ${manual} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program OPTIONAL)
  endif()
endif()

set(DUET_INSTALLED_ROOMS ${rooms})
set(DUET_INSTALLED_PARTS ${part_libraries})
list(TRANSFORM DUET_INSTALLED_PARTS REPLACE "^duet_" "duet::")
configure_package_config_file(cmake/duetConfig.cmake.in ${PROJECT_BINARY_DIR}/package/duetConfig.cmake
                              INSTALL_DESTINATION ${package})
# Until 1.0 each minor version may break what the one before it promised.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/duetConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/package/duetConfig.cmake ${PROJECT_BINARY_DIR}/package/duetConfigVersion.cmake
              cmake/duet_engine_module.cmake cmake/duet_location.cpp.in
        DESTINATION ${package} COMPONENT library)

# Static libraries: whoever links by pkg-config needs all that they need, in the order of the rooms from above.
set(ordered ${libraries})
list(REVERSE ordered)
list(TRANSFORM ordered PREPEND -l)
list(JOIN ordered " " DUET_LIBRARY_FLAGS)
file(RELATIVE_PATH DUET_UP /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/duet.pc.in ${PROJECT_BINARY_DIR}/package/duet.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/package/duet.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT library)
