// Words of commands that people or schedulers give to a shell: hints with the name of a folder, scripts of Slurm.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace duet {

// `text` as one word of a POSIX shell: in single quotes where it has anything but letters, digits and _./:=,+-@%.
std::string shell_word(std::string_view text);
// Words with a space between them.
std::string shell_words(const std::vector<std::string>& words);

}  // namespace duet
