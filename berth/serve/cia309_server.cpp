#include "berth/serve/cia309_server.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "berth/io/acceptor.hpp"
#include "berth/serve/cia309_client.hpp"

namespace berth::serve::cia309 {

class Server::Impl final {
 public:
  Impl(io::Loop& loop, int fd, tree::Session& session, ServerOptions options);
  ~Impl() { clients_.clear(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  class Client;
  void take(int fd);
  [[nodiscard]] std::size_t clients() const noexcept;

  io::Loop* loop;
  ServerOptions options;
  Counters counters;
  io::Endpoint where;
  io::BoundedLines tell;
  io::Seats seats;
  House house;

  class Reaper final : public rt::Job {
   public:
    explicit Reaper(Impl& server) : server_(&server) {}
    void run() noexcept override;

   private:
    Impl* server_;
  };
  Reaper reaper{*this};

 private:
  std::vector<std::unique_ptr<Client>> clients_;
  io::Acceptor acceptor_;
};

/// One connection: bytes to lines, lines to a conversation, replies to bytes.
class Server::Impl::Client final : private io::Watcher, private io::Seat::Sitter {
 public:
  Client(Impl& server, int fd)
      : server_(&server),
        name_(io::peer_name(fd)),
        stream_(*server.loop, fd, io::Stream::Kind::socket, *this, server.options.most_waiting),
        conversation_(
            server.house, [this](std::string_view text) { say(text); }, [this] { work(); }) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() = default;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] bool over() const noexcept { return over_; }
  void sit_down() {
    io::Seat::Sitter& sitter = *this;
    seat_.emplace(server_->seats, sitter, std::string(io::without_port(name_)));
  }
  void end(const std::string& why) {
    if (std::exchange(over_, true)) return;
    if (stream_.too_slow()) ++server_->counters.too_slow;
    if (!stream_.gone()) last_word();
    stream_.close();
    flush_.cancel();
    if (seat_) seat_->leave();
    server_->tell(fmt::format("{}: {}", name_, why));
    server_->loop->executor().post(server_->reaper);
  }

 private:
  template <void (Client::*Method)()>
  class Call final : public rt::Job {
   public:
    explicit Call(Client& client) : client_(&client) {}
    void run() noexcept override { (client_->*Method)(); }

   private:
    Client* client_;
  };

  // If bytes are unread at the close, the system resets the connection and the last message is lost.
  void last_word() {
    stream_.flush();
    ::shutdown(stream_.descriptor(), SHUT_WR);
    std::array<char, 4096> unread{};
    for (int i = 0; i < 16 && !stream_.get(unread).empty();) ++i;
  }
  // io::Seat::Sitter
  [[nodiscard]] bool owed() const noexcept override { return !conversation_.idle(); }
  void seat_lost(io::Seat::End how) noexcept override {
    ++server_->counters.silent;
    end(server_->seats.why(how));
  }

  void say(std::string_view text) {
    if (over_) return;
    if (!stream_.put(text)) {
      return end(stream_.too_slow() ? "too slow: it does not read the replies to its commands" : "gone");
    }
    if (!flush_.ready()) server_->loop->executor().post(flush_);
  }
  void flush() {
    if (over_) return;
    if (!stream_.flush()) return end("gone");
    if (seat_) seat_->output(stream_.taken(), stream_.waiting());
    if (hung_up_ && in_.empty() && conversation_.idle() && stream_.waiting() == 0) end("left");
  }

  void ready(std::uint32_t events) noexcept override {
    if (over_) return;
    if ((events & EPOLLOUT) != 0) flush();
    if (over_ || stream_.held()) {
      if (!over_ && (events & (EPOLLHUP | EPOLLERR)) != 0) end("gone");
      if (!over_ && (events & EPOLLRDHUP) != 0) stream_.hung_up();
      return;
    }
    char one = 0;
    if (::recv(stream_.descriptor(), &one, 1, MSG_PEEK | MSG_DONTWAIT) == 0) return half_closed();
    std::array<char, 4096> buffer;  // small pieces, so that other clients need not wait long
    in_ += stream_.get(buffer);
    if (stream_.gone()) return end("gone");
    work();
  }

  // The client sends no more, but may still read.
  void half_closed() {
    hung_up_ = true;
    stream_.hold(true);
    stream_.hung_up();
    if (!in_.empty()) in_ += '\n';  // the last line may lack its end
    work();
  }

  void work() {
    while (!over_ && !conversation_.full() && line()) {
    }
    if (over_) return;
    in_.erase(0, std::exchange(at_, 0));
    stream_.hold(hung_up_ || conversation_.full());
    if (seat_) seat_->begun(!stream_.held() && !in_.empty());  // if held, the server causes the delay
    if (hung_up_ && !flush_.ready()) server_->loop->executor().post(flush_);
  }

  // Takes one line from `in_`. False: there is none.
  bool line() {
    const auto end = in_.find('\n', at_);
    const auto rest = std::string_view(in_).substr(at_, end == std::string::npos ? end : end - at_);
    const bool too_long = rest.size() > conversation_.command_size() + 1;  // 1: the CR
    if (end == std::string::npos && !too_long && !skipping_) return false;
    if (!skipping_) {
      ++server_->counters.lines;
      if (!commanded_ && !begins(rest, too_long)) return false;
      if (commanded_ && seat_) seat_->whole_request();
      too_long ? conversation_.take_too_long(rest) : conversation_.take(rest);
    }
    skipping_ = end == std::string::npos;
    at_ = skipping_ ? in_.size() : end + 1;
    return !skipping_;
  }

  // A client of this protocol begins with a command. False: this one does not, and is disconnected.
  bool begins(std::string_view rest, bool too_long) {
    const auto first = parse_line(rest.substr(0, conversation_.command_size()));
    if (!too_long && first.error != Code::syntax) {
      commanded_ = !first.error && first.request.verb != Verb::nothing;
      return true;
    }
    const bool http = rest.substr(0, 4096).find(" HTTP/") != std::string_view::npos;
    ++server_->counters.strange;
    say(error_line(first.request.sequence, too_long ? Code::no_memory : Code::syntax));
    end(http ? "spoke HTTP: a web page, or a program that takes this for a web server"
             : "began with something else than a command");
    return false;
  }

  Impl* server_;
  std::string name_;
  io::Stream stream_;
  Call<&Client::flush> flush_{*this};
  std::optional<io::Seat> seat_;  // none: too many clients
  std::string in_;
  std::size_t at_ = 0;     // in `in_`: earlier lines are done
  bool skipping_ = false;  // the rest of a line that is too long
  bool commanded_ = false;
  bool hung_up_ = false;
  bool over_ = false;
  Conversation conversation_;  // last: it uses the other members
};

Server::Impl::Impl(io::Loop& on, int fd, tree::Session& session, ServerOptions wanted)
    : loop(&on),
      options(std::move(wanted)),
      where(io::local_endpoint(fd).value_or(io::Endpoint{})),
      tell(on.executor(), options.tell),
      seats(on.executor(), options.seats),
      house{&session, options.commands, options.confirmed, [this](const std::string& line) { tell(line); }, {}},
      acceptor_(on, fd, [this](int connection) { take(connection); }) {}

void Server::Impl::Reaper::run() noexcept {
  std::erase_if(server_->clients_, [](const auto& client) { return client->over(); });
}

std::size_t Server::Impl::clients() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(clients_, [](const auto& c) { return !c->over(); }));
}

void Server::Impl::take(int fd) {
  io::tune_tcp(fd);
  ++counters.clients;
  const std::string name = io::peer_name(fd);
  const bool room = seats.make_room(io::without_port(name));
  if (!room) ++counters.too_many;
  clients_.push_back(std::make_unique<Client>(*this, fd));
  if (!room) return clients_.back()->end("one too many");
  clients_.back()->sit_down();
  tell(name + ": connected");
}

tl::expected<std::unique_ptr<Server>, std::string> Server::listen(io::Loop& loop, const io::Endpoint& where,
                                                                  tree::Session& session, ServerOptions options) {
  const auto fd = io::listen_tcp(where);
  if (!fd) return tl::unexpected(fd.error());
  return std::unique_ptr<Server>(new Server(std::make_unique<Impl>(loop, *fd, session, std::move(options))));
}

Server::Server(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Server::~Server() = default;
const io::Endpoint& Server::where() const noexcept { return impl_->where; }
std::size_t Server::clients() const noexcept { return impl_->clients(); }
const Counters& Server::counters() const noexcept { return impl_->counters; }

}  // namespace berth::serve::cia309
