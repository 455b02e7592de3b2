# Writes build_info.h: what the program was built from and with. Run at each build, so that the commit is the one that is
# built; the file keeps its time where nothing changed.
# -D SOURCE= OUTPUT= COMPILER= BUILD_TYPE= FLAGS= VERSION=
set(commit "")
find_program(GIT git)
if(GIT)
  # The index must not be refreshed: a commit in another terminal would meet its lock.
  execute_process(COMMAND ${GIT} --no-optional-locks describe --always --dirty --abbrev=40 --exclude=*
                  WORKING_DIRECTORY ${SOURCE} OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT [[
#pragma once
#include <string_view>

namespace duet::build_info {

inline constexpr std::string_view kVersion = "@VERSION@";
inline constexpr std::string_view kCommit = "@commit@";
inline constexpr std::string_view kCompiler = "@COMPILER@";
inline constexpr std::string_view kBuildType = "@BUILD_TYPE@";
inline constexpr std::string_view kFlags = R"(@FLAGS@)";

}  // namespace duet::build_info
]])
