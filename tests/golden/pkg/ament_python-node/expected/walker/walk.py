def main():
    print('Hi from walker.')


if __name__ == '__main__':
    main()
