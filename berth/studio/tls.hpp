// A user's certificate and its key: with them Studio uses TLS, and other computers may connect. OpenSSL is only in
// tls.cpp and in the sources of the server's thread.
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/io/stream.hpp"

namespace berth::studio {

class Tls {
 public:
  /// Both files in PEM; the certificate's may contain the chain up to the authority. TLS 1.2 and 1.3. Refused, with the
  /// file and the reason: an unreadable file, a key with a passphrase, a key that others can read, and one that does
  /// not belong to the certificate.
  [[nodiscard]] static tl::expected<std::unique_ptr<Tls>, std::string> load(const std::string& certificate,
                                                                            const std::string& key);

  [[nodiscard]] boost::asio::ssl::context& context() noexcept { return context_; }
  /// Whether the certificate is for this name or address ("plant.example", "10.0.0.5", "::1").
  [[nodiscard]] bool names(const std::string& host) const;
  /// A name or address of the certificate that can be opened; empty: it has none.
  [[nodiscard]] std::string first_name() const;

 private:
  Tls();
  boost::asio::ssl::context context_;
  boost::asio::ssl::context::native_handle_type native_ = context_.native_handle();
};

/// Why an address is refused without a certificate, and how to make one.
[[nodiscard]] std::string needs_certificate(const io::Endpoint& where);

}  // namespace berth::studio
