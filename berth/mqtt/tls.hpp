/// TLS of a client: what it trusts and shows, and what its handshakes tell. Internal to room `mqtt`.
///
/// libmosquitto could set TLS up by itself, but reports every fault of it as one and the same. So the context is made
/// here: the broker's name is always verified, TLS is 1.2 or 1.3, and `TlsNews` gets what was found.
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

  [[nodiscard]] ssl_ctx_st* context() const noexcept { return context_; }
  [[nodiscard]] const std::string& host() const noexcept { return host_; }

 private:
  explicit Tls(std::string host);
  [[nodiscard]] tl::expected<void, std::string> trust(const std::string& authorities);
  [[nodiscard]] tl::expected<void, std::string> show(const std::string& certificate, const std::string& key);
  [[nodiscard]] bool expect_host();

  ssl_ctx_st* context_;
  std::string host_;
};

/// One connection's handshake, of a context of `Tls`; `ssl` null: there is no TLS.
/// From now on `news` is told; it must stay as long as the connection.
void tell(ssl_st* ssl, TlsNews& news) noexcept;
/// Not done yet.
[[nodiscard]] bool is_shaking_hands(const ssl_st* ssl) noexcept;
/// It waits until it can write.
[[nodiscard]] bool wants_to_write(const ssl_st* ssl) noexcept;

}  // namespace berth::mqtt
