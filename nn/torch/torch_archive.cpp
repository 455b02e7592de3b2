#include "duet/nn/torch/torch_archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr ZipLimits kLimits{.entry_bytes = std::size_t{1} << 28, .total_bytes = std::size_t{1} << 29};

std::vector<float> floats(const TorchArchive& archive, const std::string& entry, const std::string& content) {
  if (content.size() % sizeof(float) != 0)
    archive.refuse(fmt::format("tensor '{}': expected 4 bytes a number, found {} bytes", entry, content.size()));
  std::vector<float> values(content.size() / sizeof(float));
  if (!values.empty()) std::memcpy(values.data(), content.data(), content.size());
  return values;
}

void take(TorchArchive& archive, const std::string& entry, const std::string& content) {
  if (entry == "data.pkl") archive.pickle = content;
  if (entry.starts_with("code/") && entry.ends_with(".py")) archive.sources[entry.substr(5)] = content;
  if (entry == "byteorder" && !content.starts_with("little")) archive.refuse("expected little-endian numbers");
  if (!entry.starts_with("data/")) return;
  const std::string number = entry.substr(5);
  if (number.empty() || number.size() > 4 || !std::ranges::all_of(number, [](char c) { return c >= '0' && c <= '9'; }))
    archive.refuse(fmt::format("expected tensors numbered from 0, found '{}'", entry));
  archive.tensors[std::stoi(number)] = floats(archive, entry, content);
}

}  // namespace

void TorchArchive::refuse(const std::string& problem) const {
  throw InputError(fmt::format("'{}': TorchScript: {}", file, excerpt(problem, kShownSentence)));
}

bool holds_torch_code(std::string_view bytes, const std::string& file) {
  bool found = false;
  const auto is_code = [&](const std::string& entry) {
    found = found || entry.find("/code/") != std::string::npos || entry.starts_with("code/");
    return false;  // the name is enough
  };
  read_zip(bytes, file, kLimits, is_code, [](const std::string&, const std::string&) {});
  return found;
}

const std::vector<float>& TorchArchive::finite(int number) const {
  const std::vector<float>& values = tensors.at(number);
  for (const float value : values)
    if (!std::isfinite(value))
      refuse(fmt::format("tensor 'data/{}': expected finite numbers, found {}", number, value));
  return values;
}

TorchArchive read_torch_archive(std::string_view bytes, const std::string& file) {
  TorchArchive archive{.file = file};
  read_zip(bytes, file, kLimits, [&](const std::string& entry, const std::string& content) {
    // "policy/data/0", "policy/data.pkl", "policy/code/..." : the first folder has any name.
    take(archive, entry.substr(std::min(entry.find('/') + 1, entry.size())), content);
  });
  if (archive.pickle.empty()) archive.refuse("expected an entry 'data.pkl', found none");
  return archive;
}

namespace {

constexpr std::size_t kMostTorchNodes = 100'000;  // a policy's module has some hundreds

class TorchReader {
 public:
  explicit TorchReader(const TorchArchive& archive) : archive_(archive), rest_(archive.pickle) {}

  TorchPickle read() {
    while (!stopped_) {
      const auto code = static_cast<unsigned char>(take(1)[0]);
      if (!read_value(code) && !read_container(code) && !read_memo(code) && !read_call(code))
        fail(fmt::format("expected an opcode of a module of tensors, found 0x{:02x}", code));
    }
    return std::move(out_);
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    archive_.refuse(fmt::format("data.pkl: {} (TorchScript of another kind; needs libtorch)", problem));
  }

  std::string_view take(std::size_t count) {
    if (count > rest_.size()) fail("truncated");
    const std::string_view part = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return part;
  }

  std::int64_t whole(int bytes) {  // little-endian
    std::uint64_t value = 0;
    const std::string_view part = take(static_cast<std::size_t>(bytes));
    for (int i = bytes - 1; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(part[i]);
    return static_cast<std::int64_t>(value);
  }

  double real() {  // big-endian
    std::uint64_t bits = 0;
    for (const char byte : take(8)) bits = bits << 8 | static_cast<unsigned char>(byte);
    return std::bit_cast<double>(bits);
  }

  std::string line() {
    const std::size_t end = rest_.find('\n');
    if (end == std::string_view::npos) fail("truncated");
    std::string text(take(end + 1));
    text.pop_back();
    return text;
  }

  void push(TorchNode node) {
    if (out_.nodes.size() >= kMostTorchNodes) fail("too many values");
    out_.nodes.push_back(std::move(node));
    stack_.push_back(static_cast<int>(out_.nodes.size()) - 1);
  }

  int pop() {
    if (stack_.empty() || (!marks_.empty() && stack_.size() <= marks_.back())) fail("a value is missing");
    const int node = stack_.back();
    stack_.pop_back();
    return node;
  }

  std::vector<int> pop_to_mark() {
    if (marks_.empty() || marks_.back() > stack_.size()) fail("a value is missing");
    std::vector<int> items(stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back()), stack_.end());
    stack_.resize(marks_.back());
    marks_.pop_back();
    return items;
  }

  const TorchNode& expect(int place, TorchKind kind, const char* what) const {
    if (out_.nodes[place].kind != kind) fail(fmt::format("expected {}, found another value", what));
    return out_.nodes[place];
  }

  TorchNode& top() {
    const int node = pop();
    stack_.push_back(node);
    return out_.nodes[node];
  }

  bool read_value(unsigned char code) {
    switch (code) {
      case 0x80:  // PROTO
        return whole(1), true;
      case 'N':
        return push({}), true;
      case 0x88:
      case 0x89:  // NEWTRUE, NEWFALSE
        return push({.kind = TorchKind::kNumber, .number = code == 0x88 ? 1 : 0}), true;
      case 'K':
        return push({.kind = TorchKind::kNumber, .number = whole(1)}), true;
      case 'M':
        return push({.kind = TorchKind::kNumber, .number = whole(2)}), true;
      case 'J':
        return push({.kind = TorchKind::kNumber, .number = static_cast<std::int32_t>(whole(4))}), true;
      case 'G':
        return push({.kind = TorchKind::kReal, .real = real()}), true;
      case 'X':
        return push({.kind = TorchKind::kText, .text = std::string(take(static_cast<std::size_t>(whole(4))))}), true;
      default:
        return false;
    }
  }

  void push_tuple(std::vector<int> items) { push({.kind = TorchKind::kTuple, .items = std::move(items)}); }

  void push_last(int count) {
    std::vector<int> items(count);
    for (int i = count - 1; i >= 0; --i) items[i] = pop();
    push_tuple(std::move(items));
  }

  bool read_container(unsigned char code) {
    switch (code) {
      case '(':
        return marks_.push_back(stack_.size()), true;
      case ')':
      case ']':
        return push_tuple({}), true;
      case '}':
        return push({.kind = TorchKind::kDict}), true;
      case 't':
        return push_tuple(pop_to_mark()), true;
      case 0x85:
      case 0x86:
      case 0x87:
        return push_last(code - 0x84), true;
      case 'e': {
        const std::vector<int> items = pop_to_mark();
        std::vector<int>& to = top().items;
        to.insert(to.end(), items.begin(), items.end());
        return true;
      }
      case 'u':
        return set_items(pop_to_mark()), true;
      default:
        return false;
    }
  }

  // Keys that are no texts (line numbers, which the tracer leaves) are dropped.
  void set_items(const std::vector<int>& pairs) {
    if (pairs.size() % 2 != 0) fail("a value is missing");
    TorchNode& to = top();
    if (to.kind != TorchKind::kDict) fail("expected a dict, found another value");
    for (std::size_t i = 0; i < pairs.size(); i += 2)
      if (out_.nodes[pairs[i]].kind == TorchKind::kText) to.members[out_.nodes[pairs[i]].text] = pairs[i + 1];
  }

  bool read_memo(unsigned char code) {
    if (code == 'q' || code == 'r') {
      const std::int64_t key = whole(code == 'q' ? 1 : 4);
      (void)top();
      memo_[key] = stack_.back();
      return true;
    }
    if (code != 'h' && code != 'j') return false;
    const auto found = memo_.find(whole(code == 'h' ? 1 : 4));
    if (found == memo_.end()) fail("a value is missing");
    stack_.push_back(found->second);
    return true;
  }

  bool read_call(unsigned char code) {
    switch (code) {
      case 'c': {
        const std::string module = line();
        return push({.kind = TorchKind::kClass, .text = module + "." + line()}), true;
      }
      case 'Q':
        return read_storage(), true;
      case 0x81:
        return make_object(), true;
      case 'b':
        return build_object(), true;
      case 'R':
        return reduce(), true;
      case '.':
        out_.root = pop();
        return stopped_ = true, true;
      default:
        return false;
    }
  }

  // ("storage", class of its numbers, "0", device, count)
  void read_storage() {
    const std::vector<int> items = expect(pop(), TorchKind::kTuple, "a storage").items;
    if (items.size() != 5) fail("expected a storage, found another value");
    const std::string key = expect(items[2], TorchKind::kText, "a storage's number").text;
    TorchNode storage{.kind = TorchKind::kStorage, .text = expect(items[1], TorchKind::kClass, "a class").text};
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), storage.storage);
    if (error != std::errc() || end != key.data() + key.size())
      fail(fmt::format("expected a storage's number, found '{}'", key));
    push(std::move(storage));
  }

  void make_object() {
    (void)pop();  // arguments: none
    push({.kind = TorchKind::kObject, .text = expect(pop(), TorchKind::kClass, "a class").text});
  }

  void build_object() {
    const std::map<std::string, int> members = expect(pop(), TorchKind::kDict, "an object's members").members;
    TorchNode& object = top();
    if (object.kind != TorchKind::kObject) fail("expected an object, found another value");
    object.members = members;
  }

  // The few functions that a module's file calls.
  void reduce() {
    const std::vector<int> items = expect(pop(), TorchKind::kTuple, "arguments").items;
    const std::string name = expect(pop(), TorchKind::kClass, "a function").text;
    if (name == "torch._utils._rebuild_tensor_v2") return rebuild_tensor(items);
    if (name == "collections.OrderedDict") return push({.kind = TorchKind::kDict});
    if (!name.starts_with("torch.jit._pickle.") || items.empty())
      fail(fmt::format("expected a call that rebuilds a tensor or restores a type, found '{}'", name));
    stack_.push_back(items[0]);  // restore_type_tag(value, type), build_intlist(values)
  }

  std::vector<std::int64_t> sizes_of(int place) const {
    std::vector<std::int64_t> sizes;
    for (const int item : expect(place, TorchKind::kTuple, "a tensor's sizes").items)
      sizes.push_back(expect(item, TorchKind::kNumber, "a tensor's size").number);
    return sizes;
  }

  // (storage, first, sizes, strides, ...)
  void rebuild_tensor(const std::vector<int>& items) {
    if (items.size() < 4) fail("expected a tensor, found another value");
    const TorchNode& storage = expect(items[0], TorchKind::kStorage, "a storage");
    push({.kind = TorchKind::kTensor,
          .number = expect(items[1], TorchKind::kNumber, "a tensor's first number").number,
          .text = storage.text,
          .storage = storage.storage,
          .sizes = sizes_of(items[2]),
          .strides = sizes_of(items[3])});
  }

  const TorchArchive& archive_;
  std::string_view rest_;
  TorchPickle out_;
  std::vector<int> stack_;
  std::vector<std::size_t> marks_;
  std::map<std::int64_t, int> memo_;
  bool stopped_ = false;
};

}  // namespace

TorchPickle read_torch_pickle(const TorchArchive& archive) { return TorchReader(archive).read(); }

}  // namespace duet
