#include "berth/serve/socketcand_server.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <algorithm>
#include <optional>

#include "berth/io/acceptor.hpp"
#include "berth/serve/client.hpp"

namespace berth::serve {

class SocketcandServer::Impl final {
 public:
  Impl(io::Loop& loop, int fd, Factory factory, ServerOptions options)
      : loop_(&loop),
        factory_(std::move(factory)),
        options_(std::move(options)),
        seats_(loop.executor(), options_.seats),
        tell_(loop.executor(), options_.tell) {
    where_ = io::local_endpoint(fd).value_or(io::Endpoint{});
    house_ = {loop_, &options_, &factory_, &counters_, options_.epoch, &reaper_, &seats_, &tell_};
    if (house_.epoch.count() == 0) {
      const auto wall = std::chrono::system_clock::now().time_since_epoch();
      house_.epoch = std::chrono::duration_cast<std::chrono::microseconds>(wall - loop.clock().time_since_epoch());
    }
    acceptor_.emplace(loop, fd, [this](int client) { take(client); });
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] const io::Endpoint& where() const noexcept { return where_; }
  [[nodiscard]] const ServerCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::size_t clients() const noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(clients_, [](const auto& c) { return !c->over(); }));
  }

 private:
  class Reaper final : public rt::Job {
   public:
    explicit Reaper(Impl& server) : server_(&server) {}
    void run() noexcept override {
      std::erase_if(server_->clients_, [](const auto& c) { return c->over(); });
    }

   private:
    Impl* server_;
  };

  void take(int fd) {
    io::tune_tcp(fd);
    const int kernel_buffer = 1 << 17;  // small: bytes wait in Berth's own buffer, which counts them
    ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kernel_buffer, sizeof kernel_buffer);
    ++counters_.clients;
    const std::string name = io::peer_name(fd);
    const bool room = seats_.make_room(io::without_port(name));
    clients_.push_back(std::make_unique<Client>(house_, fd, name));
    if (room) return clients_.back()->greet();
    clients_.back()->end("one too many", "< error too many clients >");
  }

  io::Loop* loop_;
  io::Endpoint where_;
  Factory factory_;
  ServerOptions options_;
  ServerCounters counters_;
  io::Seats seats_;
  io::BoundedLines tell_;
  Reaper reaper_{*this};
  Client::House house_;
  std::vector<std::unique_ptr<Client>> clients_;
  std::optional<io::Acceptor> acceptor_;
};

tl::expected<std::unique_ptr<SocketcandServer>, std::string> SocketcandServer::listen(io::Loop& loop,
                                                                                      const io::Endpoint& where,
                                                                                      Factory factory,
                                                                                      ServerOptions options) {
  const auto fd = io::listen_tcp(where);
  if (!fd) return tl::unexpected(fd.error());
  return std::unique_ptr<SocketcandServer>(
      new SocketcandServer(std::make_unique<Impl>(loop, *fd, std::move(factory), std::move(options))));
}

SocketcandServer::SocketcandServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SocketcandServer::~SocketcandServer() = default;
const io::Endpoint& SocketcandServer::where() const noexcept { return impl_->where(); }
std::size_t SocketcandServer::clients() const noexcept { return impl_->clients(); }
const ServerCounters& SocketcandServer::counters() const noexcept { return impl_->counters(); }

}  // namespace berth::serve
