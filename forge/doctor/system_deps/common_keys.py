"""A table of common rosdep keys with their names in apt, dnf and pip, for machines without rosdep.

'-' means that there is no package, ',' separates several names. Names for apt are those of Debian 12 and
Ubuntu 22.04 or later, names for dnf those of Fedora and openEuler.
"""

from __future__ import annotations

from typing import Any

_TABLE = """
asio                        libasio-dev                   asio-devel                    -
assimp                      libassimp-dev                 assimp-devel                  -
benchmark                   libbenchmark-dev              google-benchmark-devel        -
binutils                    binutils-dev                  binutils-devel                -
boost                       libboost-all-dev              boost-devel                   -
build-essential             build-essential               gcc,gcc-c++,make              -
bullet                      libbullet-dev                 bullet-devel                  -
bzip2                       libbz2-dev                    bzip2-devel                   -
can-utils                   can-utils                     can-utils                     -
clang-format                clang-format                  clang-tools-extra             -
clang-tidy                  clang-tidy                    clang-tools-extra             -
cmake                       cmake                         cmake                         cmake
cppcheck                    cppcheck                      cppcheck                      -
cppzmq                      cppzmq-dev                    cppzmq-devel                  -
curl                        libcurl4-openssl-dev          libcurl-devel                 -
cxxopts                     libcxxopts-dev                cxxopts-devel                 -
doxygen                     doxygen                       doxygen                       -
eigen                       libeigen3-dev                 eigen3-devel                  -
eigen3                      libeigen3-dev                 eigen3-devel                  -
ffmpeg                      ffmpeg                        ffmpeg                        -
fftw3                       libfftw3-dev                  fftw-devel                    -
fmt                         libfmt-dev                    fmt-devel                     -
g++-static                  g++                           libstdc++-static              -
geographiclib               libgeographic-dev             GeographicLib-devel           -
gfortran                    gfortran                      gcc-gfortran                  -
git                         git                           git                           -
glut                        freeglut3-dev                 freeglut-devel                -
google-mock                 google-mock                   gmock-devel                   -
graphviz                    graphviz                      graphviz                      -
gtest                       libgtest-dev                  gtest-devel                   -
hdf5                        libhdf5-dev                   hdf5-devel                    -
libabsl-dev                 libabsl-dev                   abseil-cpp-devel              -
libboost-dev                libboost-dev                  boost-devel                   -
libboost-filesystem-dev     libboost-filesystem-dev       boost-devel                   -
libboost-program-options-dev libboost-program-options-dev boost-devel                   -
libboost-python-dev         libboost-python-dev           boost-python3-devel           -
libboost-system-dev         libboost-system-dev           boost-devel                   -
libboost-thread-dev         libboost-thread-dev           boost-devel                   -
libcap-dev                  libcap-dev                    libcap-devel                  -
libceres-dev                libceres-dev                  ceres-solver-devel            -
libconsole-bridge-dev       libconsole-bridge-dev         console-bridge-devel          -
libcurl-dev                 libcurl4-openssl-dev          libcurl-devel                 -
libfcl-dev                  libfcl-dev                    fcl-devel                     -
libgflags-dev               libgflags-dev                 gflags-devel                  -
libglew-dev                 libglew-dev                   glew-devel                    -
libglfw3-dev                libglfw3-dev                  glfw-devel                    -
libglm-dev                  libglm-dev                    glm-devel                     -
libgoogle-glog-dev          libgoogle-glog-dev            glog-devel                    -
libgpiod-dev                libgpiod-dev                  libgpiod-devel                -
libgps                      libgps-dev                    gpsd-devel                    -
libjpeg                     libjpeg-dev                   libjpeg-turbo-devel           -
libjsoncpp-dev              libjsoncpp-dev                jsoncpp-devel                 -
liblz4-dev                  liblz4-dev                    lz4-devel                     -
libmodbus-dev               libmodbus-dev                 libmodbus-devel               -
libmosquitto-dev            libmosquitto-dev              mosquitto-devel               -
libncurses-dev              libncurses-dev                ncurses-devel                 -
libnl-3-dev                 libnl-3-dev                   libnl3-devel                  -
libomp-dev                  libomp-dev                    libomp-devel                  -
libopenblas-dev             libopenblas-dev               openblas-devel                -
libopencv-dev               libopencv-dev                 opencv-devel                  -
libpcap                     libpcap-dev                   libpcap-devel                 -
libpcl-all-dev              libpcl-dev                    pcl-devel                     -
libpng-dev                  libpng-dev                    libpng-devel                  -
libpoco-dev                 libpoco-dev                   poco-devel                    -
libqt5-core                 libqt5core5a                  qt5-qtbase                    -
libqt5-gui                  libqt5gui5                    qt5-qtbase-gui                -
libqt5-widgets              libqt5widgets5                qt5-qtbase-gui                -
libreadline-dev             libreadline-dev               readline-devel                -
libserial-dev               libserial-dev                 -                             -
libspdlog-dev               libspdlog-dev                 spdlog-devel                  -
libsqlite3-dev              libsqlite3-dev                sqlite-devel                  -
libssl-dev                  libssl-dev                    openssl-devel                 -
libturbojpeg                libturbojpeg0-dev             turbojpeg-devel               -
libudev-dev                 libudev-dev                   systemd-devel                 -
liburdfdom-dev              liburdfdom-dev                urdfdom-devel                 -
libusb-1.0-dev              libusb-1.0-0-dev              libusbx-devel                 -
libv4l-dev                  libv4l-dev                    libv4l-devel                  -
libx11-dev                  libx11-dev                    libX11-devel                  -
libxml2                     libxml2-dev                   libxml2-devel                 -
libxml2-utils               libxml2-utils                 libxml2                       -
libyaml-cpp-dev             libyaml-cpp-dev               yaml-cpp-devel                -
libyaml-dev                 libyaml-dev                   libyaml-devel                 -
libzmq3-dev                 libzmq3-dev                   zeromq-devel                  -
libzstd-dev                 libzstd-dev                   libzstd-devel                 -
nlohmann-json-dev           nlohmann-json3-dev            json-devel                    -
opengl                      libgl1-mesa-dev               mesa-libGL-devel              -
openssl                     openssl                       openssl                       -
orocos_kdl                  liborocos-kdl-dev             orocos-kdl-devel              -
pkg-config                  pkg-config                    pkgconf-pkg-config            -
portaudio19-dev             portaudio19-dev               portaudio-devel               -
protobuf                    libprotobuf-dev               protobuf-devel                protobuf
protobuf-dev                libprotobuf-dev,protobuf-compiler protobuf-devel,protobuf-compiler -
pybind11-dev                pybind11-dev                  pybind11-devel                pybind11
python3                     python3                       python3                       -
python3-argcomplete         python3-argcomplete           python3-argcomplete           argcomplete
python3-babeltrace          python3-babeltrace            python3-babeltrace            -
python3-catkin-pkg          python3-catkin-pkg            python3-catkin_pkg            catkin_pkg
python3-catkin-pkg-modules  python3-catkin-pkg-modules    python3-catkin_pkg            catkin_pkg
python3-cryptography        python3-cryptography          python3-cryptography          cryptography
python3-dev                 python3-dev                   python3-devel                 -
python3-docutils            python3-docutils              python3-docutils              docutils
python3-empy                python3-empy                  python3-empy                  empy<4
python3-flake8              python3-flake8                python3-flake8                flake8
python3-flask               python3-flask                 python3-flask                 flask
python3-gi                  python3-gi                    python3-gobject               PyGObject
python3-importlib-metadata  python3-importlib-metadata    python3-importlib-metadata    importlib-metadata
python3-jinja2              python3-jinja2                python3-jinja2                jinja2
python3-jsonschema          python3-jsonschema            python3-jsonschema            jsonschema
python3-lark-parser         python3-lark                  python3-lark-parser           lark
python3-lxml                python3-lxml                  python3-lxml                  lxml
python3-matplotlib          python3-matplotlib            python3-matplotlib            matplotlib
python3-mock                python3-mock                  python3-mock                  mock
python3-mypy                python3-mypy                  python3-mypy                  mypy
python3-netifaces           python3-netifaces             python3-netifaces             netifaces
python3-networkx            python3-networkx              python3-networkx              networkx
python3-nose                python3-nose                  python3-nose                  nose
python3-numpy               python3-numpy                 python3-numpy                 numpy
python3-opencv              python3-opencv                python3-opencv                opencv-python
python3-packaging           python3-packaging             python3-packaging             packaging
python3-pandas              python3-pandas                python3-pandas                pandas
python3-paramiko            python3-paramiko              python3-paramiko              paramiko
python3-pexpect             python3-pexpect               python3-pexpect               pexpect
python3-pil                 python3-pil                   python3-pillow                pillow
python3-pip                 python3-pip                   python3-pip                   -
python3-pkg-resources       python3-pkg-resources         python3-setuptools            setuptools
python3-prompt-toolkit      python3-prompt-toolkit        python3-prompt-toolkit        prompt_toolkit
python3-psutil              python3-psutil                python3-psutil                psutil
python3-pycodestyle         python3-pycodestyle           python3-pycodestyle           pycodestyle
python3-pydocstyle          python3-pydocstyle            python3-pydocstyle            pydocstyle
python3-pydot               python3-pydot                 python3-pydot                 pydot
python3-pygame              python3-pygame                python3-pygame                pygame
python3-pygments            python3-pygments              python3-pygments              pygments
python3-pygraphviz          python3-pygraphviz            python3-pygraphviz            pygraphviz
python3-pymodbus            python3-pymodbus              python3-pymodbus              pymodbus
python3-pyproj              python3-pyproj                python3-pyproj                pyproj
python3-pyqt5               python3-pyqt5                 python3-qt5                   PyQt5
python3-pytest              python3-pytest                python3-pytest                pytest
python3-pytest-asyncio      python3-pytest-asyncio        python3-pytest-asyncio        pytest-asyncio
python3-pytest-cov          python3-pytest-cov            python3-pytest-cov            pytest-cov
python3-pytest-mock         python3-pytest-mock           python3-pytest-mock           pytest-mock
python3-pytest-timeout      python3-pytest-timeout        python3-pytest-timeout        pytest-timeout
python3-requests            python3-requests              python3-requests              requests
python3-rosdistro-modules   -                             python3-rosdistro             rosdistro
python3-rospkg-modules      python3-rospkg-modules        python3-rospkg                rospkg
python3-scipy               python3-scipy                 python3-scipy                 scipy
python3-serial              python3-serial                python3-pyserial              pyserial
python3-setuptools          python3-setuptools            python3-setuptools            setuptools
python3-shapely             python3-shapely               python3-shapely               shapely
python3-sklearn             python3-sklearn               python3-scikit-learn          scikit-learn
python3-smbus               python3-smbus                 python3-i2c-tools             smbus2
python3-sympy               python3-sympy                 python3-sympy                 sympy
python3-tabulate            python3-tabulate              python3-tabulate              tabulate
python3-termcolor           python3-termcolor             python3-termcolor             termcolor
python3-tk                  python3-tk                    python3-tkinter               -
python3-toml                python3-toml                  python3-toml                  toml
python3-tornado             python3-tornado               python3-tornado               tornado
python3-tqdm                python3-tqdm                  python3-tqdm                  tqdm
python3-transforms3d        -                             python3-transforms3d          transforms3d
python3-typeguard           python3-typeguard             python3-typeguard             typeguard
python3-typing-extensions   python3-typing-extensions     python3-typing-extensions     typing_extensions
python3-vcstool             vcstool                       python3-vcstool               vcstool
python3-venv                python3-venv                  python3                       -
python3-websocket           python3-websocket             python3-websocket-client      websocket-client
python3-websockets          python3-websockets            python3-websockets            websockets
python3-wheel               python3-wheel                 python3-wheel                 wheel
python3-yaml                python3-yaml                  python3-pyyaml                PyYAML
python3-zmq                 python3-zmq                   python3-zmq                   pyzmq
qt5-qmake                   qt5-qmake                     qt5-qtbase-devel              -
qtbase5-dev                 qtbase5-dev                   qt5-qtbase-devel              -
rapidjson-dev               rapidjson-dev                 rapidjson-devel               -
screen                      screen                        screen                        -
sdl                         libsdl1.2-dev                 SDL-devel                     -
sdl2                        libsdl2-dev                   SDL2-devel                    -
sqlite3                     sqlite3                       sqlite                        -
suitesparse                 libsuitesparse-dev            suitesparse-devel             -
tbb                         libtbb-dev                    tbb-devel                     -
tinyxml                     libtinyxml-dev                tinyxml-devel                 -
tinyxml2                    libtinyxml2-dev               tinyxml2-devel                -
tmux                        tmux                          tmux                          -
uncrustify                  uncrustify                    uncrustify                    -
unzip                       unzip                         unzip                         -
uuid                        uuid-dev                      libuuid-devel                 -
wget                        wget                          wget                          -
xterm                       xterm                         xterm                         -
yaml-cpp                    libyaml-cpp-dev               yaml-cpp-devel                -
zlib                        zlib1g-dev                    zlib-devel                    -
"""

_APT, _DNF = ("debian", "ubuntu"), ("fedora", "openeuler", "rhel")


def common_keys() -> dict[str, Any]:
    """Return the table as a database; pip is used if the system has no package."""
    return {words[0]: _rules(*words[1:]) for words in map(str.split, _TABLE.strip().splitlines())}


def _rules(apt: str, dnf: str, pip: str) -> dict[str, Any]:
    systems = {**dict.fromkeys(_APT, apt), **dict.fromkeys(_DNF, dnf)}
    rules: dict[str, Any] = {}
    for system, names in systems.items():
        if names != "-":
            rules[system] = names.split(",")
        elif pip != "-":
            rules[system] = {"pip": {"packages": [pip]}}
    return rules
