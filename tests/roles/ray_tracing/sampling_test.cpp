int not_empty;
