# duet_add_engine_module(<name> SOURCES ... INCLUDE <folders> LINK ...): the target duet_engine_<name>, an engine of duet as
# a module duet_<name>.so (docs/extending.md). The engine's own headers, in the folders INCLUDE, are seen here only.
function(duet_add_engine_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;INCLUDE;LINK" ${ARGN})
  add_library(duet_engine_${name} MODULE ${ARG_SOURCES})
  set_target_properties(duet_engine_${name} PROPERTIES PREFIX "" OUTPUT_NAME duet_${name})
  target_link_libraries(duet_engine_${name} PRIVATE duet::backends ${ARG_LINK})
  target_include_directories(duet_engine_${name} SYSTEM PRIVATE ${ARG_INCLUDE})
endfunction()
