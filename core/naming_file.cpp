#include "duet/core/naming_file.h"

namespace duet {

std::string naming_file_message(const std::string& path, const std::string& message) {
  return message.find(path) == std::string::npos ? path + ": " + message : message;
}

}  // namespace duet
