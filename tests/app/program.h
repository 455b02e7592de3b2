// Runs the built `duet` as a user does. Another one may stand in for it: ./run mutants sets DUET_PROGRAM.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "duet/core/file.h"
#include "tests/support.h"

namespace duet::test {

inline std::string setting(const char* name, const std::string& otherwise) {
  const char* set = std::getenv(name);
  return set != nullptr && *set != '\0' ? set : otherwise;
}
inline std::string program() { return setting("DUET_PROGRAM", DUET_PROGRAM); }
inline std::string built_engines() { return setting("DUET_ENGINES", DUET_BUILT_ENGINES); }

struct Answer {
  int code = -1;
  std::string out, err;
};

// With `arguments` in a shell; `prefix`: variables and what else stands before it.
inline Answer duet_program(const std::string& arguments, const std::string& prefix = "") {
  const ScratchFolder folder;
  const std::string err = folder / "stderr";
  FILE* pipe = popen((prefix + " " + program() + " " + arguments + " 2>" + err).c_str(), "r");
  Answer answer;
  std::array<char, 4096> buffer{};
  for (size_t n = fread(buffer.data(), 1, buffer.size(), pipe); n > 0; n = fread(buffer.data(), 1, buffer.size(), pipe))
    answer.out.append(buffer.data(), n);
  answer.code = WEXITSTATUS(pclose(pipe));
  answer.err = read_file(err);
  return answer;
}

}  // namespace duet::test
