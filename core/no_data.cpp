#include "duet/core/no_data.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "duet/core/require.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

struct Beginning {
  std::string_view bytes;
  std::string_view fault;
};

constexpr std::string_view kLfs =
    "this is a Git LFS pointer, which stands in the place of the file: `git lfs pull` fetches the file itself";
constexpr std::string_view kAnnex =
    "this is a git-annex pointer, which stands in the place of the file: `git annex get` fetches the file itself";
constexpr std::string_view kOffice =
    "this is a document of an office program: save the table as CSV in UTF-8 and give that";
constexpr std::string_view kMatlab =
    "this is a MATLAB file: write its arrays to an NPZ (docs/file-formats.md has an example) and give that";
constexpr std::string_view kPage =
    "this is an HTML page, such as a server sends in the place of a file: fetch the file itself";
constexpr std::string_view kXmlError =
    "this is an error message of a server in XML, in the place of the file: fetch the file itself";

constexpr std::array<Beginning, 11> kBeginnings = {{{"version https://git-lfs.github.com/spec/", kLfs},
                                                    {"version https://hawser.github.com/spec/", kLfs},
                                                    {"/annex/objects/", kAnnex},
                                                    {"../.git/annex/objects/", kAnnex},
                                                    {".git/annex/objects/", kAnnex},
                                                    {"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", kOffice},
                                                    {"MATLAB 5.0 MAT-file", kMatlab},
                                                    {"MATLAB 7.", kMatlab},
                                                    {"%PDF-", "this is a PDF document, not data"},
                                                    {"Rar!\x1a\x07", "this is a RAR archive: unpack it"},
                                                    {"7z\xbc\xaf\x27\x1c", "this is a 7z archive: unpack it"}}};

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

// The name of the first entry of a zip archive tells OpenDocument and Office Open XML from NPZ and TorchScript.
bool is_office_archive(std::string_view bytes) {
  constexpr std::size_t kNameAt = 30;
  if (!bytes.starts_with("PK\x03\x04") || bytes.size() <= kNameAt) return false;
  const std::string_view name = bytes.substr(kNameAt);
  return name.starts_with("[Content_Types].xml") || name.starts_with("mimetypeapplication/vnd.oasis") ||
         name.starts_with("_rels/.rels");
}

std::string_view page_fault(std::string_view bytes) {
  const std::string text =
      lower(trimmed(bytes.starts_with(kUtf8Mark) ? bytes.substr(kUtf8Mark.size()) : bytes, " \t\r\n"));
  const std::string_view view = text;
  for (const std::string_view tag : {"<!doctype html", "<html", "<head>", "<body"})
    if (view.starts_with(tag)) return kPage;
  if (!view.starts_with("<?xml") && !view.starts_with("<!--")) return {};
  if (view.find("<html") != std::string_view::npos || view.find("<!doctype html") != std::string_view::npos)
    return kPage;
  return view.find("<error>") != std::string_view::npos && view.find("<code>") != std::string_view::npos ? kXmlError
                                                                                                         : ""sv;
}

bool is_plain(char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t'; }

// Whether the first characters are plain ones of `width` bytes each, the plain byte at `place`, after a mark of as many
// bytes or of none.
bool is_wide_text(std::string_view bytes, std::size_t width, std::size_t place) {
  constexpr std::size_t kCharacters = 4;
  if (bytes.size() < width * kCharacters) return false;
  for (std::size_t i = 0; i < width * kCharacters; ++i)
    if (i % width == place ? !is_plain(bytes[i]) : bytes[i] != '\0') return false;
  return true;
}

std::string_view wide_text(std::string_view bytes) {
  const auto without = [&](std::string_view mark) {
    return bytes.starts_with(mark) ? bytes.substr(mark.size()) : bytes;
  };
  if (is_wide_text(without("\xff\xfe\0\0"sv), 4, 0) || is_wide_text(without("\0\0\xfe\xff"sv), 4, 3)) return "UTF-32";
  if (is_wide_text(without("\xff\xfe"sv), 2, 0) || is_wide_text(without("\xfe\xff"sv), 2, 1)) return "UTF-16";
  return {};
}

}  // namespace

std::string no_data_fault(std::string_view first_bytes) {
  const std::string_view bytes = first_bytes.substr(0, kToldBytes);
  for (const Beginning& known : kBeginnings)
    if (bytes.starts_with(known.bytes)) return std::string(known.fault);
  if (is_office_archive(bytes)) return std::string(kOffice);
  if (const std::string_view encoding = wide_text(bytes); !encoding.empty())
    return "this is text in " + std::string(encoding) + ": expected UTF-8, save it so";
  return std::string(page_fault(bytes));
}

void refuse_no_data(const std::string& path, std::string_view first_bytes) {
  const std::string fault = no_data_fault(first_bytes);
  if (fault.empty() || (fault == kPage && (path.ends_with(".html") || path.ends_with(".htm")))) return;
  throw InputError("'" + shown(path, kShownSentence) + "': " + fault);
}

std::string_view without_byte_order_mark(std::string_view text) {
  return text.starts_with(kUtf8Mark) ? text.substr(kUtf8Mark.size()) : text;
}

std::string plain_text(std::string text) {
  text.erase(0, text.size() - without_byte_order_mark(text).size());
  std::size_t to = text.find('\r');
  if (to == std::string::npos) return text;
  for (std::size_t from = to; from < text.size(); ++from) {
    if (text[from] != '\r')
      text[to++] = text[from];
    else if (from + 1 == text.size() || text[from + 1] != '\n')
      text[to++] = '\n';
  }
  text.resize(to);
  return text;
}

}  // namespace duet
