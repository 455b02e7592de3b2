#include "duet/app/cli/field_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/require.h"

namespace duet::cli {

void add_field(CLI::App& command, const FieldWords& words, const std::string& values, const std::string& fallback,
               const std::function<std::string(const std::string&)>& set, bool many) {
  FieldWords flag = words;
  flag.name = "--" + words.name;
  std::replace(flag.name.begin(), flag.name.end(), '_', '-');
  const auto read = [flag, set](const std::vector<std::string>& texts) {
    const std::string text = fmt::format("{}", fmt::join(texts, " "));
    const std::string expected = set(text);
    require(expected.empty(), field_refusal(flag, expected, text));
  };
  command
      .add_option_function<std::vector<std::string>>((words.name == "output" ? "-o," : "") + flag.name, read,
                                                     fmt::format("{} ({})", words.meaning, values))
      ->expected(1, many ? CLI::detail::expected_max_vector_size : 1)
      ->type_name("")
      ->default_str(fallback);
}

}  // namespace duet::cli
