#include "duet/core/digest.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <filesystem>
#include <stdexcept>

#include "duet/core/file.h"

namespace duet {
namespace {

void check(bool ok) {
  if (!ok) throw std::runtime_error("OpenSSL refuses SHA-256");
}

struct FreeDigest {
  void operator()(EVP_MD* digest) const { EVP_MD_free(digest); }
};

// Looked up once: a look-up takes locks, and a third of the time of a short text's hash.
const EVP_MD* sha256() {
  static const std::unique_ptr<EVP_MD, FreeDigest> fetched(EVP_MD_fetch(nullptr, "SHA256", nullptr));
  check(fetched != nullptr);
  return fetched.get();
}

using DigestBytes = std::array<unsigned char, EVP_MAX_MD_SIZE>;

std::string hex_text(const DigestBytes& digest, unsigned int size) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string text;
  text.reserve(std::size_t{2} * size);
  for (unsigned int i = 0; i < size; ++i) {
    text += kHex[digest[i] >> 4U];
    text += kHex[digest[i] & 15U];
  }
  return text;
}

}  // namespace

struct Sha256::Context {
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> evp{EVP_MD_CTX_new()};
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  check(context_->evp != nullptr && EVP_DigestInit_ex(context_->evp.get(), sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(std::span<const std::byte> bytes) {
  check(EVP_DigestUpdate(context_->evp.get(), bytes.data(), bytes.size()) == 1);
}

void Sha256::update(std::string_view text) { update(std::as_bytes(std::span(text.data(), text.size()))); }

void Sha256::update(std::span<const double> values) { update(std::as_bytes(values)); }

void Sha256::update(const RobotState& state) {
  const Eigen::Quaterniond& R = state.X_WB.R;
  const Eigen::Vector3d& p = state.X_WB.p;
  const std::array<double, 7> quat_wxyz_position = {R.w(), R.x(), R.y(), R.z(), p.x(), p.y(), p.z()};
  const auto span_of = [](const auto& vector) {
    return std::span<const double>(vector.data(), static_cast<std::size_t>(vector.size()));
  };
  update(std::span<const double>(quat_wxyz_position));
  update(span_of(state.v_WB));
  update(span_of(state.w_WB_B));
  update(span_of(state.q));
  update(span_of(state.v));
}

std::string Sha256::hex() const {
  const std::unique_ptr<EVP_MD_CTX, Context::Free> copy(EVP_MD_CTX_new());
  DigestBytes digest{};
  unsigned int size = 0;
  check(copy != nullptr && EVP_MD_CTX_copy_ex(copy.get(), context_->evp.get()) == 1 &&
        EVP_DigestFinal_ex(copy.get(), digest.data(), &size) == 1);
  return hex_text(digest, size);
}

std::string sha256_hex(std::string_view text) {
  DigestBytes digest{};
  unsigned int size = 0;
  check(EVP_Digest(text.data(), text.size(), digest.data(), &size, sha256(), nullptr) == 1);
  return hex_text(digest, size);
}

std::string sha256_file(const std::string& path) { return sha256_hex(read_file(path)); }

namespace {

std::string whole_path(const std::string& path) { return std::filesystem::absolute(path).lexically_normal().string(); }

// The innermost of this thread: a reader knows nothing of who wants to know what it read.
DigestReads*& innermost() {
  thread_local DigestReads* reads = nullptr;
  return reads;
}

}  // namespace

std::string FileDigests::find(const std::string& path) const {
  const auto found = by_path_.find(whole_path(path));
  return found == by_path_.end() ? "" : found->second;
}

std::string FileDigests::of(const std::string& path) {
  if (std::string known = find(path); !known.empty()) return known;
  std::string digest = sha256_file(path);
  add(path, digest);
  return digest;
}

void FileDigests::add(const std::string& path, const std::string& sha256) {
  const auto [entry, added] = by_path_.try_emplace(whole_path(path), sha256);
  if (!added && entry->second != sha256)
    throw InputError(
        fmt::format("'{}' was replaced while it was used: SHA-256 {:.12} when it was read first, {:.12} now", path,
                    entry->second, sha256));
}

DigestReads::DigestReads(FileDigests& digests) : digests_(digests), outer_(innermost()) {
  innermost() = this;
  read_observer() = note;
}

DigestReads::~DigestReads() {
  innermost() = outer_;
  if (outer_ == nullptr) read_observer() = nullptr;
}

void DigestReads::note(const std::string& path, std::string_view bytes) {
  if (innermost() == nullptr) return;
  const std::string digest = sha256_hex(bytes);
  for (DigestReads* reads = innermost(); reads != nullptr; reads = reads->outer_) reads->digests_.add(path, digest);
}

}  // namespace duet
