#include "berth/serve/socketcand_server.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "berth/serve/client.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

class SocketcandServer::Impl final : private io::Watcher {
 public:
  Impl(io::Loop& loop, int fd, Factory factory, ServerOptions options)
      : loop_(&loop), fd_(fd), factory_(std::move(factory)), options_(std::move(options)) {
    where_ = io::local_endpoint(fd).value_or(io::Endpoint{});
    house_ = {loop_, &options_, &factory_, &counters_, options_.epoch, &reaper_};
    if (house_.epoch.count() == 0) {
      const auto wall = std::chrono::system_clock::now().time_since_epoch();
      house_.epoch = std::chrono::duration_cast<std::chrono::microseconds>(wall - loop.clock().time_since_epoch());
    }
    loop_->watch(fd_, *this, EPOLLIN);
  }
  ~Impl() {
    clients_.clear();
    loop_->forget(fd_);
    ::close(fd_);
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
  // Without descriptors the listening socket would stay ready for ever and the loop would never sleep.
  class Again final : public rt::Job {
   public:
    explicit Again(Impl& server) : server_(&server) {}
    void run() noexcept override { server_->loop_->watch(server_->fd_, *server_, EPOLLIN); }

   private:
    Impl* server_;
  };

  void ready(std::uint32_t) noexcept override {
    for (;;) {
      const int fd = ::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (fd >= 0) {
        take(fd);
      } else if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
        loop_->forget(fd_);
        loop_->executor().after(1s, again_);
        return;
      } else if (errno != EINTR && errno != ECONNABORTED) {
        return;
      }
    }
  }

  void take(int fd) {
    io::tune_tcp(fd);
    const int kernel_buffer = 1 << 17;  // what waits shall wait here, where it is counted
    ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kernel_buffer, sizeof kernel_buffer);
    ++counters_.clients;
    const bool room = clients() < options_.most_clients;
    clients_.push_back(std::make_unique<Client>(house_, fd, io::peer_name(fd)));
    if (room) return clients_.back()->greet();
    clients_.back()->end("one too many", "< error too many clients >");
  }

  io::Loop* loop_;
  int fd_;
  io::Endpoint where_;
  Factory factory_;
  ServerOptions options_;
  ServerCounters counters_;
  Reaper reaper_{*this};
  Again again_{*this};
  Client::House house_;
  std::vector<std::unique_ptr<Client>> clients_;
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
