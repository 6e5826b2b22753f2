/// The TLS of many clients: a thousand clients of one broker read their files once. Internal to room `mqtt`.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/mqtt/tls.hpp"

namespace berth::mqtt {

class TlsCache {
 public:
  /// As `Tls::load`. The files are read again when one of them has changed: a renewed certificate needs no new start.
  [[nodiscard]] tl::expected<std::shared_ptr<Tls>, std::string> get(const TlsFiles& files, const std::string& host);

 private:
  /// Of a file: what tells that it was replaced or written.
  struct Stamp {
    std::uint64_t inode = 0;
    std::int64_t size = -1;  // -1: it is not there
    std::int64_t changed_s = 0;
    std::int64_t changed_ns = 0;
    friend bool operator==(const Stamp&, const Stamp&) = default;
  };
  using Stamps = std::array<Stamp, 3>;
  struct Known {
    TlsFiles files;
    std::string host;
    Stamps stamps;
    std::shared_ptr<Tls> tls;
  };
  [[nodiscard]] static Stamp stamp_of(const std::string& file) noexcept;
  [[nodiscard]] static Stamps stamps_of(const TlsFiles& files) noexcept;

  std::vector<Known> known_;
};

}  // namespace berth::mqtt
