// Names the file in errors that are found only after it was read. Thread-safe.
#pragma once

#include <new>
#include <string>
#include <utility>

#include "duet/core/file.h"

namespace duet {

// "FILE: MESSAGE", or the message alone where it names the file already.
std::string naming_file_message(const std::string& path, const std::string& message);

// The result of `work`. Its InputError, std::invalid_argument and std::bad_alloc become an InputError that names the
// file.
template <typename Work>
decltype(auto) naming_file(const std::string& path, Work&& work) {
  try {
    return std::forward<Work>(work)();
  } catch (const StorageError&) {
    throw;  // the disk's fault, not the file's
  } catch (const InputError& error) {
    throw InputError(naming_file_message(path, error.what()));
  } catch (const std::invalid_argument& error) {
    throw InputError(naming_file_message(path, error.what()));
  } catch (const std::bad_alloc&) {
    throw InputError(naming_file_message(path, "there is not enough memory for it"));
  }
}

}  // namespace duet
