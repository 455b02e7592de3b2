// Detection of a file that is no data at all, by its first bytes: a pointer of Git LFS, a page that a server sent, text
// in another encoding, a document of an office. Thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace duet {

inline constexpr std::size_t kToldBytes = 1024;  // from the beginning of a file, enough for every kind

// A sentence without the file's name ("this is a Git LFS pointer, ..."); "" where the bytes may be data.
std::string no_data_fault(std::string_view first_bytes);

// Throws InputError ("'FILE': this is ...") for the first bytes of a file. A file that is named ".html" may be a page.
void refuse_no_data(const std::string& path, std::string_view first_bytes);

// Text without the byte order mark that some editors write before UTF-8.
std::string_view without_byte_order_mark(std::string_view text);

// Text of any system: without that mark, and with "\n" in the place of "\r\n" and of "\r" alone.
std::string plain_text(std::string text);

}  // namespace duet
