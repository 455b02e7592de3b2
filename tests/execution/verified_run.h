// A run that a test makes, changes and has verified.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "duet/core/file.h"
#include "duet/execution/runner.h"
#include "duet/execution/verification.h"

namespace duet::test {

// One sentence of what `duet verify --all` has against a run; "" where it has nothing.
inline std::string objection(const std::string& folder, const std::string& clips = "") {
  Progress quiet(Progress::Style::kQuiet);
  try {
    const Verification found = verify_run(load_run(folder), {.all = true, .threads = 2, .clips = clips}, quiet);
    if (!found.faults.empty()) return found.faults.front();
    if (!found.missing.empty()) return found.missing.front();
    for (const RepeatedEpisode& repeat : found.repeats)
      if (!repeat.differences.empty()) return "differs: " + differences_text(repeat.differences);
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

inline void make_run(const Suite& suite, const std::string& folder) {
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.threads = 2;
  run_suite(suite, folder, options, quiet);
}

inline void replace_in(const std::string& file, const std::string& from, const std::string& to) {
  std::string text = read_file(file);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_file(file, text.replace(at, from.size(), to));
}

}  // namespace duet::test
