#include "duet/archives/pickle/pickle_machine.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <unordered_map>
#include <utility>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/pickle/pickle_objects.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// A motion of NumPy arrays has some hundreds of objects; a file of many more is something else.
constexpr std::size_t kMostNodes = 1'000'000;
struct KnownOpcode {
  unsigned char code;
  std::string_view name;
};

// Opcodes that make objects or leave the file; named in the refusal.
constexpr std::array<KnownOpcode, 15> kRefused = {{{'i', "INST"},
                                                   {'o', "OBJ"},
                                                   {0x81, "NEWOBJ"},
                                                   {0x92, "NEWOBJ_EX"},
                                                   {0x82, "EXT1"},
                                                   {0x83, "EXT2"},
                                                   {0x84, "EXT4"},
                                                   {'P', "PERSID"},
                                                   {'Q', "BINPERSID"},
                                                   {0x97, "NEXT_BUFFER"},
                                                   {0x98, "READONLY_BUFFER"},
                                                   {'S', "STRING"},
                                                   {'T', "BINSTRING"},
                                                   {'U', "SHORT_BINSTRING"},
                                                   {0x8b, "LONG4"}}};

class PickleMachine {
 public:
  PickleMachine(std::string_view bytes, const std::string& name, PickleFlavour flavour) : in_(bytes, name) {
    pickle_.name = name;
    pickle_.flavour = flavour;
  }

  Pickle run() {
    if (in_.left() == 0) throw InputError(fmt::format("'{}': the file is empty, expected a pickle", pickle_.name));
    if (const std::uint64_t first = in_.unsigned_number(1); first != 0x80)
      fail(fmt::format("expected a pickle of protocol 2 to 5 (byte 0x80), found byte 0x{:02x}", first));
    if (const std::uint64_t protocol = in_.unsigned_number(1); protocol < 2 || protocol > 5)
      fail(fmt::format("expected pickle protocol 2 to 5, found {}", protocol));
    while (!stopped_) {
      const unsigned char code = in_.next_opcode();
      if (!push_constant(code) && !push_old_text(code) && !build_container(code) && !use_memo(code) &&
          !make_object(code))
        refuse(code);
    }
    if (in_.left() != 0) fail(fmt::format("expected the end of the file after STOP, found {} more bytes", in_.left()));
    return std::move(pickle_);
  }

 private:
  [[noreturn]] void fail(const std::string& fault) const { in_.fail(fault); }

  [[noreturn]] void refuse(unsigned char code) const {
    for (const KnownOpcode& known : kRefused)
      if (known.code == code)
        fail(fmt::format("opcode {} is refused: expected a dict of NumPy arrays, which does not use it", known.name));
    fail(fmt::format("expected an opcode of a dict of NumPy arrays, found 0x{:02x}", code));
  }

  // ---- stack -------------------------------------------------------------------------------------------------------

  int add(PickleNode node) {
    if (pickle_.nodes.size() >= kMostNodes) fail(fmt::format("more than {} objects", kMostNodes));
    node.offset = in_.opcode();
    pickle_.nodes.push_back(std::move(node));
    return static_cast<int>(pickle_.nodes.size()) - 1;
  }
  void push(PickleNode node) { stack_.push_back(add(std::move(node))); }
  void push_text(PickleKind kind, std::string_view text) { push({.kind = kind, .text = text}); }

  [[nodiscard]] std::size_t floor() const { return marks_.empty() ? 0 : marks_.back(); }

  int pop() {
    if (stack_.size() <= floor()) fail("expected a value on the stack, found none");
    const int node = stack_.back();
    stack_.pop_back();
    return node;
  }
  PickleNode& top(PickleKind kind) {
    if (stack_.size() <= floor()) fail("expected a value on the stack, found none");
    return expect(stack_.back(), kind, "the value on the stack");
  }
  PickleNode& expect(int index, PickleKind kind, std::string_view what) {
    PickleNode& node = pickle_.nodes[index];
    if (node.kind != kind) fail(fmt::format("{}: expected {}, found {}", what, to_string(kind), to_string(node.kind)));
    return node;
  }
  std::vector<int> pop_to_mark() {
    if (marks_.empty()) fail("expected a MARK on the stack, found none");
    const auto begin = stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back());
    std::vector<int> items(begin, stack_.end());
    stack_.erase(begin, stack_.end());
    marks_.pop_back();
    return items;
  }
  void push_tuple(std::vector<int> items) { push({.kind = PickleKind::kTuple, .items = std::move(items)}); }
  void push_tuple_of(int count) {
    std::vector<int> items(count);
    for (int i = count - 1; i >= 0; --i) items[i] = pop();
    push_tuple(std::move(items));
  }

  // ---- opcodes; each returns false where the opcode is not one of its own -------------------------------------------

  bool push_constant(unsigned char code) {
    switch (code) {
      case 'N':
        push({});
        return true;
      case 0x88:
        push({.kind = PickleKind::kBool, .integer = 1});
        return true;
      case 0x89:
        push({.kind = PickleKind::kBool, .integer = 0});
        return true;
      case 'J':
        push({.kind = PickleKind::kInt, .integer = static_cast<std::int32_t>(in_.unsigned_number(4))});
        return true;
      case 'K':
        push_integer(in_.unsigned_number(1));
        return true;
      case 'M':
        push_integer(in_.unsigned_number(2));
        return true;
      case 0x8a:
        push({.kind = PickleKind::kInt, .integer = in_.long_number()});
        return true;
      case 'G':
        push_float();
        return true;
      case 0x8c:
        push_text(PickleKind::kText, in_.take(in_.unsigned_number(1)));
        return true;
      case 'X':
        push_text(PickleKind::kText, in_.take(in_.unsigned_number(4)));
        return true;
      case 0x8d:
        push_text(PickleKind::kText, in_.take(in_.unsigned_number(8)));
        return true;
      case 'C':
        push_text(PickleKind::kBytes, in_.take(in_.unsigned_number(1)));
        return true;
      case 'B':
        push_text(PickleKind::kBytes, in_.take(in_.unsigned_number(4)));
        return true;
      case 0x8e:
      case 0x96:
        push_text(PickleKind::kBytes, in_.take(in_.unsigned_number(8)));
        return true;
      default:
        return false;
    }
  }

  bool push_old_text(unsigned char code) {
    if (pickle_.flavour != PickleFlavour::kModel || (code != 'U' && code != 'T')) return false;
    const std::string_view text = in_.take(in_.unsigned_number(code == 'U' ? 1 : 4));
    push({.kind = PickleKind::kText, .text = text, .old_text = true});
    return true;
  }

  bool build_container(unsigned char code) {
    switch (code) {
      case '(':
        marks_.push_back(stack_.size());
        return true;
      case '}':
        push({.kind = PickleKind::kDict});
        return true;
      case ']':
        push({.kind = PickleKind::kList});
        return true;
      case ')':
        push_tuple({});
        return true;
      case 't':
        push_tuple(pop_to_mark());
        return true;
      case 0x85:
        push_tuple_of(1);
        return true;
      case 0x86:
        push_tuple_of(2);
        return true;
      case 0x87:
        push_tuple_of(3);
        return true;
      case 'a':
        append(PickleKind::kList, {pop()});
        return true;
      case 'e':
        append(PickleKind::kList, pop_to_mark());
        return true;
      case 's': {
        const int value = pop();
        append(PickleKind::kDict, {pop(), value});
        return true;
      }
      case 'u':
        append(PickleKind::kDict, pop_to_mark());
        return true;
      default:
        return false;
    }
  }

  bool use_memo(unsigned char code) {
    switch (code) {
      case 'q':
        put(in_.unsigned_number(1));
        return true;
      case 'r':
        put(in_.unsigned_number(4));
        return true;
      case 0x94:
        put(memo_.size());
        return true;
      case 'h':
        get(in_.unsigned_number(1));
        return true;
      case 'j':
        get(in_.unsigned_number(4));
        return true;
      default:
        return false;
    }
  }

  bool make_object(unsigned char code) {
    switch (code) {
      case 0x95:
        check_frame(in_.unsigned_number(8));
        return true;
      case 'c': {
        const std::string_view module = in_.line();
        push_callable(module, in_.line());
        return true;
      }
      case 0x93: {
        const int name = pop();
        const std::string_view module = expect(pop(), PickleKind::kText, "module of a class").text;
        push_callable(module, expect(name, PickleKind::kText, "name of a class").text);
        return true;
      }
      case 'R':
        reduce();
        return true;
      case 'b':
        build();
        return true;
      case 0x81:
        return make_known_object();
      case 'Q':
        return read_storage();
      case '.':
        stop();
        return true;
      default:
        return false;
    }
  }

  void push_integer(std::uint64_t value) {
    push({.kind = PickleKind::kInt, .integer = static_cast<std::int64_t>(value)});
  }
  void push_float() {  // big-endian
    std::uint64_t bits = 0;
    for (const char c : in_.take(8)) bits = bits << 8 | static_cast<unsigned char>(c);
    push({.kind = PickleKind::kFloat, .number = std::bit_cast<double>(bits)});
  }
  void append(PickleKind kind, const std::vector<int>& values) {
    if (kind == PickleKind::kDict && values.size() % 2 != 0) fail("expected keys and values in pairs");
    std::vector<int>& items = top(kind).items;
    items.insert(items.end(), values.begin(), values.end());
  }
  void put(std::uint64_t key) {
    if (stack_.size() <= floor()) fail("expected a value on the stack, found none");
    memo_[key] = stack_.back();
  }
  void get(std::uint64_t key) {
    const auto found = memo_.find(key);
    if (found == memo_.end()) fail(fmt::format("memo {} was never stored", key));
    stack_.push_back(found->second);
  }
  void check_frame(std::uint64_t size) const {
    if (size > in_.left())
      fail(fmt::format("the file is truncated: a frame of {} bytes begins, {} are left", size, in_.left()));
  }
  void stop() {
    if (!marks_.empty() || stack_.size() != 1) fail("expected one value at STOP");
    pickle_.root = stack_.back();
    stopped_ = true;
  }

  // ---- NumPy's objects ----------------------------------------------------------------------------------------------

  void push_callable(std::string_view module, std::string_view name) {
    push({.kind = PickleKind::kCallable, .text = name, .callable = find_callable(pickle_, in_.opcode(), module, name)});
  }
  void reduce() {
    const int arguments = pop();
    expect(arguments, PickleKind::kTuple, "arguments of a call");
    const PickleCallable callable = expect(pop(), PickleKind::kCallable, "what is called").callable;
    push(reduced(pickle_, in_.opcode(), callable, pickle_.nodes[arguments].items));
  }
  void build() {
    const int state = pop();
    if (stack_.size() <= floor()) fail("expected an object to build, found none");
    const int object = stack_.back();
    if (pickle_[object].kind == PickleKind::kObject) return build_members(object, state);
    expect(state, PickleKind::kTuple, "state of an object");
    build_object(pickle_, in_.opcode(), object, pickle_.nodes[state].items);
  }

  // ---- passive objects of joblib and SciPy
  // ---------------------------------------------------------------------------

  [[nodiscard]] bool may(PickleFlavour flavour) const { return pickle_.flavour == flavour; }

  bool make_known_object() {
    if (!may(PickleFlavour::kJoblib) && !may(PickleFlavour::kModel)) return false;
    const int arguments = pop();
    if (!expect(arguments, PickleKind::kTuple, "arguments of an object").items.empty())
      fail("arguments of an object: expected none");
    const PickleNode& type = expect(pop(), PickleKind::kCallable, "class of an object");
    if (type.callable != PickleCallable::kJoblibArray && type.callable != PickleCallable::kSparse)
      fail(fmt::format("an object of '{}' is refused: expected an array", excerpt(type.text)));
    push({.kind = PickleKind::kObject, .text = type.text, .callable = type.callable});
    return true;
  }

  void build_members(int object, int state) {
    const std::vector<int> items = expect(state, PickleKind::kDict, "state of an object").items;
    if (pickle_[object].built) fail("an object is built twice");
    pickle_.nodes[object].items = items;
    pickle_.nodes[object].built = true;
    if (pickle_[object].callable == PickleCallable::kJoblibArray) read_joblib_array(object);
  }

  // The bytes of joblib's arrays follow the opcode that describes them; the description becomes the array.
  void read_joblib_array(int object) {
    PickleNode array = joblib_array(pickle_, in_.opcode(), pickle_[object]);
    if (array.integer > 0) in_.take(in_.unsigned_number(1));  // as many as align what follows
    const std::size_t size = array_bytes(pickle_, in_.opcode(), array);
    array.data = add({.kind = PickleKind::kBytes, .text = in_.take(size)});
    array.offset = pickle_[object].offset;
    pickle_.nodes[object] = std::move(array);
  }

  bool read_storage() {
    if (!may(PickleFlavour::kTorch)) return false;
    const int identity = pop();
    push(torch_storage(pickle_, in_.opcode(), identity));
    return true;
  }

  PickleStream in_;
  Pickle pickle_;
  std::vector<int> stack_;
  std::vector<std::size_t> marks_;
  std::unordered_map<std::uint64_t, int> memo_;
  bool stopped_ = false;
};

}  // namespace

Pickle parse_pickle(std::string_view bytes, const std::string& name, PickleFlavour flavour) {
  return PickleMachine(bytes, name, flavour).run();
}

}  // namespace duet
