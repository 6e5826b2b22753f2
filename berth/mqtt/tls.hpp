/// TLS of a client: what it trusts and shows, and what its handshakes tell. Internal to room `mqtt`.
///
/// The broker's name is always verified; TLS is 1.2 or 1.3.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/mqtt/options.hpp"

// OpenSSL's.
struct ssl_ctx_st;
struct ssl_st;

namespace berth::mqtt {

/// What became of one handshake.
struct TlsNews {
  long verification = 0;  ///< X509_V_ERR_..., 0: no fault was found
  int alert = 0;          ///< of the broker; 0: none
};

class Tls {
 public:
  /// For connections to `host`, a name or an address. The files must be readable; errors in words, with the file and
  /// what to do.
  [[nodiscard]] static tl::expected<std::shared_ptr<Tls>, std::string> load(const TlsFiles& files,
                                                                            const std::string& host);
  ~Tls();
  Tls(const Tls&) = delete;
  Tls& operator=(const Tls&) = delete;

  /// TLS over a connected socket, which stays the caller's; a new object of the caller's (SSL_free). `news` is told
  /// while it lives. Null: no memory.
  [[nodiscard]] ssl_st* begin(int fd, TlsNews& news) const noexcept;
  [[nodiscard]] const std::string& host() const noexcept { return host_; }

 private:
  explicit Tls(std::string host);
  [[nodiscard]] tl::expected<void, std::string> trust(const std::string& authorities);
  [[nodiscard]] tl::expected<void, std::string> show(const std::string& certificate, const std::string& key);
  [[nodiscard]] bool expect_host();

  ssl_ctx_st* context_;
  std::string host_;
};

}  // namespace berth::mqtt
