extern "C" int part_number() {return 1;}
