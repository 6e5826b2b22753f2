#include "berth/studio/studio.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "berth/studio/doors.hpp"
#include "berth/studio/export.hpp"
#include "berth/studio/server_parts.hpp"

namespace berth::studio {
namespace {

constexpr unsigned ports_tried = 10;

tl::expected<int, std::string> listen(io::Endpoint& where, bool named) {
  std::string first;
  for (unsigned i = 0; i < (named ? 1 : ports_tried); ++i) {
    auto fd = io::listen_tcp(where);
    if (fd) {
      if (const auto local = io::local_endpoint(*fd)) where.port = local->port;
      return fd;
    }
    if (first.empty()) first = fd.error();
    ++where.port;
  }
  return tl::unexpected(named ? first : fmt::format("{}; nor is any port up to {} free", first, where.port - 1));
}

/// Null: plain HTTP, allowed only on this computer.
tl::expected<std::unique_ptr<Tls>, std::string> secured(const Options& options) {
  if (!options.certificate.empty()) return Tls::load(options.certificate, options.key);
  const auto own = io::is_loopback(options.where);
  if (!own) return tl::unexpected(own.error());
  if (!*own) return tl::unexpected(needs_certificate(options.where));
  return nullptr;
}

std::vector<std::string> names_of(const design::Machine& machine) {
  std::vector<std::string> names;
  for (const auto* const bus : machine.all_buses()) names.push_back(bus->name);
  return names;
}

/// The host in the browser's address: as named if the certificate covers it, the bound address if only this computer
/// reaches it, else the certificate's first name.
std::string host_of(const io::Endpoint& named, const io::Endpoint& where, const Tls* tls) {
  if (tls != nullptr && tls->names(named.host)) return named.host;
  if (tls == nullptr || io::is_loopback(where).value_or(false)) return where.host;
  return tls->first_name();
}

}  // namespace

class Studio::Impl {
 public:
  Impl(int listener, io::Endpoint where, std::unique_ptr<Tls> tls, Tokens tokens, TokenFiles files, io::Loop& loop,
       tree::Session& session, Carry carry, const Options& options)
      : where_(std::move(where)),
        files_(std::move(files)),
        buses_(names_of(session.machine())),
        link_(options.frames),
        shown_{host_of(options.where, where_, tls.get()), where_.port},
        hall_(listener, where_.host.find(':') != std::string::npos, where_.port, std::move(tls), std::move(tokens),
              Mirror(session.machine(), {options.simulated, options.fleet, options.version, options.open_metrics},
                     options.token_file, options.signals),
              link_),
        desk_(loop, session, std::move(carry), link_),
        thread_([this] { hall_.run(); }) {}
  ~Impl() {
    hall_.stop();
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] const io::Endpoint& where() const noexcept { return where_; }
  [[nodiscard]] std::string page() const {
    return fmt::format("{}://{}/", hall_.tls() != nullptr ? "https" : "http", io::to_string(shown_));
  }
  [[nodiscard]] const Tokens& tokens() const noexcept { return hall_.tokens(); }
  [[nodiscard]] Desk& desk() noexcept { return desk_; }
  [[nodiscard]] RingPart ring(std::uint64_t from, std::size_t count, const std::string& filter) const {
    const std::uint64_t first = std::max(from, link_.ring.first());
    const std::uint64_t end = link_.ring.next();
    RingPart part{.next = std::min(first + count, end), .end = end};
    if (part.next <= first) return part;
    Export lines(link_.ring, buses_, {.from = first, .to = part.next - 1, .filter = filter});
    while (!lines.step(count, part.text)) {
    }
    return part;
  }

 private:
  io::Endpoint where_;
  TokenFiles files_;
  std::vector<std::string> buses_;
  Link link_;
  io::Endpoint shown_;
  Hall hall_;
  Desk desk_;
  std::thread thread_;
};

tl::expected<std::unique_ptr<Studio>, std::string> Studio::start(io::Loop& loop, tree::Session& session, Carry carry,
                                                                 const Options& options) {
  io::Endpoint where = options.where;
  auto tls = secured(options);
  if (!tls) return tl::unexpected(tls.error());
  auto tokens = options.tokens_kept.empty() ? Tokens::make() : Tokens::keep(options.tokens_kept);
  if (!tokens) return tl::unexpected(tokens.error());
  const auto fd = listen(where, options.named);
  if (!fd) return tl::unexpected(fd.error());
  TokenFiles files;
  if (!options.token_file.empty()) {
    auto written = TokenFiles::write(options.token_file, *tokens);
    if (!written) {
      ::close(*fd);
      return tl::unexpected(written.error());
    }
    files = std::move(*written);
  }
  if (const auto local = io::local_endpoint(*fd)) where.host = local->host;
  return std::unique_ptr<Studio>(
      new Studio(std::make_unique<Impl>(*fd, std::move(where), std::move(*tls), std::move(*tokens), std::move(files),
                                        loop, session, std::move(carry), options)));
}

Studio::Studio(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Studio::~Studio() = default;

std::string Studio::address(command::Role role) const {
  return fmt::format("{}#token={}", impl_->page(), impl_->tokens().of(role));
}
std::string Studio::page() const { return impl_->page(); }
const io::Endpoint& Studio::where() const noexcept { return impl_->where(); }
const Tokens& Studio::tokens() const noexcept { return impl_->tokens(); }
void Studio::event(const operate::Event& event) { impl_->desk().event(event); }
void Studio::look() { impl_->desk().look(); }
void Studio::frame(std::string_view bus, const can::Frame& frame, rt::Time at, bool own) noexcept {
  impl_->desk().frame(bus, frame, at, own);
}
void Studio::error(std::string_view bus, const can::Frame& report, rt::Time at, std::string_view about) {
  impl_->desk().error(bus, report, at, about);
}

RingPart Studio::ring(std::uint64_t from, std::size_t count, const std::string& filter) const {
  return impl_->ring(from, count, filter);
}

}  // namespace berth::studio
