#include "bench/tools/cable.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <utility>

namespace berth::bench {
namespace {

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

const sockaddr* plain(const sockaddr_in& address) {
  const void* const any = &address;
  return static_cast<const sockaddr*>(any);
}

class Cable {
 public:
  explicit Cable(std::uint16_t to_port)
      : to_(loopback(to_port)),
        listener_(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)),
        epoll_(::epoll_create1(EPOLL_CLOEXEC)) {
    const auto any = loopback(0);
    if (::bind(listener_, plain(any), sizeof any) != 0 || ::listen(listener_, 4096) != 0) std::abort();
    watch(listener_, EPOLLIN);
    watch(0, EPOLLIN);
    sockaddr_in own{};
    socklen_t size = sizeof own;
    void* const own_plain = &own;
    ::getsockname(listener_, static_cast<sockaddr*>(own_plain), &size);
    fmt::print("{}\n", ntohs(own.sin_port));
    std::fflush(stdout);
  }

  void run() {
    std::array<epoll_event, 256> events{};
    while (!over_) {
      if (cut_) {
        listen_to_person();
        continue;
      }
      const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), -1);
      for (int i = 0; i < count && !cut_ && !over_; ++i) {
        const auto& event = events[static_cast<std::size_t>(i)];
        if (event.data.fd == 0) {
          listen_to_person();
        } else if (event.data.fd == listener_) {
          join();
        } else {
          turn(event.data.fd, event.events);
        }
      }
    }
  }

 private:
  struct End {
    int other = -1;
    std::string waits{};  // to be written to this end
  };

  void watch(int fd, std::uint32_t what) const {
    epoll_event event{};
    event.events = what;
    event.data.fd = fd;
    ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event);
  }
  void change(int fd, std::uint32_t what) const {
    epoll_event event{};
    event.events = what;
    event.data.fd = fd;
    ::epoll_ctl(epoll_, EPOLL_CTL_MOD, fd, &event);
  }

  // Blocks, so that a cut cable takes no time.
  void listen_to_person() {
    std::array<char, 64> text{};
    const auto got = ::read(0, text.data(), text.size());
    if (got <= 0) over_ = true;
    const std::string line(text.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (line == "cut\n") cut_ = true;
    if (line == "mend\n" && std::exchange(cut_, false)) reset_all();
  }

  void reset_all() {
    for (int fd = accept(); fd >= 0; fd = accept()) reset(fd);
    for (const auto& [fd, end] : ends_) reset(fd);
    ends_.clear();
  }
  static void reset(int fd) {
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    ::setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    ::close(fd);
  }

  [[nodiscard]] int accept() const { return ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC); }
  void join() {
    for (int here = accept(); here >= 0; here = accept()) {
      const int there = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
      if (::connect(there, plain(to_), sizeof to_) != 0) {  // nobody listens there
        ::close(there);
        reset(here);
        continue;
      }
      for (const int fd : {here, there}) {
        const int yes = 1;
        ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
        watch(fd, EPOLLIN);
      }
      ends_[here].other = there;
      ends_[there].other = here;
    }
  }

  void part(int fd) {
    const auto end = ends_.find(fd);
    if (end == ends_.end()) return;
    const int other = end->second.other;
    ends_.erase(fd);
    ends_.erase(other);
    ::close(fd);
    ::close(other);
  }

  void turn(int fd, std::uint32_t what) {
    const auto end = ends_.find(fd);
    if (end == ends_.end()) return;
    if ((what & EPOLLOUT) != 0 && !flush(fd, end->second)) return part(fd);
    if ((what & (EPOLLIN | EPOLLHUP | EPOLLERR)) == 0) return;
    std::array<char, 65536> piece;
    const auto got = ::recv(fd, piece.data(), piece.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (got <= 0) return part(fd);
    auto& other = ends_.at(end->second.other);
    other.waits.append(piece.data(), static_cast<std::size_t>(got));
    if (!flush(end->second.other, other)) part(fd);
  }

  // False: that end is gone.
  bool flush(int fd, End& end) const {
    while (!end.waits.empty()) {
      const auto sent = ::send(fd, end.waits.data(), end.waits.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent < 0 && errno != EAGAIN) return false;
      if (sent < 0) {
        change(fd, EPOLLIN | EPOLLOUT);
        return true;
      }
      end.waits.erase(0, static_cast<std::size_t>(sent));
    }
    change(fd, EPOLLIN);
    return true;
  }

  sockaddr_in to_;
  int listener_;
  int epoll_;
  std::map<int, End> ends_;
  bool cut_ = false;
  bool over_ = false;
};

}  // namespace

int run_cable(std::uint16_t to_port) {
  Cable(to_port).run();
  return 0;
}

}  // namespace berth::bench
